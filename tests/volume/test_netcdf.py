"""NetCDF files in the layout of the SciVis contest of 2021, against NumPy arrays."""

import numpy as np
import pytest
from scipy.io import netcdf_file

from texgs.core.errors import ArgumentError
from texgs.volume.netcdf import VariableSource
from texgs.volume.sources import open_source

SIZES = {"lat": 4, "r": 5, "lon": 6}
UNITS = {"lat": "degrees_north", "r": "km", "lon": "degrees_east"}
FIELD = np.random.default_rng(0).normal(size=(4, 5, 6)).astype(np.float32)


def write_netcdf(path, fields, *, version=2, axes=tuple(SIZES), **more):
    """Write fields over latitude, radius and longitude, with more attributes."""
    with netcdf_file(path, "w", version=version) as file:
        for name, size in {"time": 2, "step": 1, **SIZES}.items():
            file.createDimension(name, size)
        for name, size in SIZES.items():
            axis = file.createVariable(name, "f8", (name,))
            axis[:], axis.units = np.arange(size), UNITS[name]
        for name, values in fields.items():
            variable = file.createVariable(name, values.dtype, axes)
            variable[:] = values
            for key, value in more.items():
                setattr(variable, key, value)
    return path


def whole(path, **keys):
    source = open_source(path, **keys)
    return source.slices(0, source.dims[2])


@pytest.mark.parametrize("version", [1, 2])
def test_a_variable_of_the_contest(tmp_path, version):
    """Longitude is x, radius y, latitude z."""
    fields = {"temperature": FIELD + 9, "temperature anomaly": FIELD, "vx": FIELD - 9}
    path = write_netcdf(tmp_path / "spherical001.nc", fields, version=version)
    source = open_source(path, variable="temperature anomaly")
    assert (source.dims, source.dtype) == ((6, 5, 4), np.float32)
    assert (source.spacing, source.origin) == ((1, 1, 1), (0, 0, 0))
    assert source.dtype.isnative
    np.testing.assert_array_equal(source.slices(0, 4), FIELD)
    np.testing.assert_array_equal(source.slices(1, 3), FIELD[1:3])


@pytest.mark.parametrize(("dimension", "axis"), [("lon", 2), ("r", 1), ("lat", 0)])
def test_a_ramp_along_a_dimension_ends_up_along_its_axis(tmp_path, dimension, axis):
    ramp = np.broadcast_to(np.arange(SIZES[dimension]).reshape(np.roll((-1, 1, 1), axis)), (4, 5, 6))
    path = write_netcdf(tmp_path / "v.nc", {"ramp": ramp.astype(np.float32)})
    slopes = [np.diff(whole(path), axis=each).max() for each in range(3)]
    assert slopes == [float(each == axis) for each in range(3)]


def test_the_only_variable_with_three_dimensions_needs_no_name(tmp_path):
    np.testing.assert_array_equal(whole(write_netcdf(tmp_path / "v.nc", {"t": FIELD})), FIELD)


@pytest.mark.parametrize("dtype", ["int8", "int16", "int32", "float64"])
def test_types(tmp_path, dtype):
    values = (100 * FIELD).clip(-128, 127).astype(dtype)
    source = open_source(write_netcdf(tmp_path / "v.nc", {"t": values}))
    assert source.dtype == dtype
    np.testing.assert_array_equal(source.slices(0, 4), values)


def test_samples_are_1_apart_unless_a_spacing_is_given(tmp_path):
    source = open_source(write_netcdf(tmp_path / "v.nc", {"t": FIELD}), spacing=(7, 8, 9), origin=(1, 2, 3))
    assert (source.spacing, source.origin) == ((7, 8, 9), (1, 2, 3))


@pytest.mark.parametrize("name", ["_FillValue", "missing_value"])
def test_packed_numbers_are_decoded_and_missing_ones_are_nan(tmp_path, name):
    stored = np.arange(120, dtype=np.int16).reshape(4, 5, 6)
    coded = {name: np.int16(7), "scale_factor": 0.5, "add_offset": 100.0}
    values = whole(write_netcdf(tmp_path / "v.nc", {"t": stored}, **coded))
    np.testing.assert_array_equal(values, np.where(stored == 7, np.nan, 100 + 0.5 * stored))
    expected = FIELD.copy()
    expected[1, 2, 3] = np.nan
    path = write_netcdf(tmp_path / "w.nc", {"t": FIELD}, **{name: FIELD[1, 2, 3]})
    np.testing.assert_array_equal(whole(path), expected)


def test_one_step_of_time_is_no_dimension_and_two_are_refused(tmp_path):
    path = write_netcdf(tmp_path / "one.nc", {"t": FIELD[None]}, axes=("step", *SIZES))
    np.testing.assert_array_equal(whole(path), FIELD)
    path = write_netcdf(tmp_path / "two.nc", {"t": np.stack([FIELD, FIELD])}, axes=("time", *SIZES))
    with pytest.raises(ArgumentError, match=r"got time 2 x lat 4 x r 5 x lon 6; .* cut out a step of time"):
        open_source(path, variable="t")
    with pytest.raises(ArgumentError, match="got none; choose one of another file, or cut"):
        open_source(path)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({}, "variable: expected one with three dimensions, got none; choose one of temperature, vx, or"),
        (
            {"variable": "vy"},
            "expected one with three dimensions, got vy; choose one of temperature, vx, or",
        ),
        ({"variable": "r"}, "expected one with three dimensions, got r 5; choose one of temperature, vx, or"),
        ({"variable": "vx", "column": 2}, "column: not for this format; leave them out"),
    ],
)
def test_mistakes(tmp_path, keys, message):
    path = write_netcdf(tmp_path / "v.nc", {"temperature": FIELD, "vx": FIELD})
    with pytest.raises(ArgumentError, match=message) as caught:
        open_source(path, **keys)
    assert str(caught.value).startswith(f"{path}: ")


@pytest.mark.parametrize("start", [b"\x89HDF\r\n\x1a\n", b"CDF\x05", b"", b"text"])
def test_other_formats_are_refused_with_the_command_that_converts_them(tmp_path, start):
    (tmp_path / "v.nc").write_bytes(start + bytes(2000))
    with pytest.raises(ArgumentError, match=r"got NetCDF-4 or another format; .*nccopy -k classic OLD\.nc"):
        open_source(tmp_path / "v.nc")


@pytest.mark.parametrize("share", [0.02, 0.1, 0.3, 0.6, 0.97])
def test_a_file_that_is_cut_off_is_refused_and_the_terminal_stays_clean(tmp_path, capfd, share):
    path = write_netcdf(tmp_path / "v.nc", {"t": FIELD})
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    with pytest.raises(ArgumentError, match=r"expected a .*NetCDF file"):
        VariableSource(path, None, None)
    assert capfd.readouterr() == ("", "")
