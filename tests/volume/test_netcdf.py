"""NetCDF files in the layout of the SciVis contest of 2021, against NumPy arrays."""

import numpy as np
import pytest
from scipy.io import netcdf_file

from texgs.volume.sources import open_source

SIZES = {"lat": 4, "r": 5, "lon": 6}
UNITS = {"lat": "degrees_north", "r": "km", "lon": "degrees_east"}
FIELD = np.random.default_rng(0).normal(size=(4, 5, 6)).astype(np.float32)


def write_netcdf(path, fields, *, version=2, **more):
    """Write fields over latitude, radius and longitude, with more attributes."""
    with netcdf_file(path, "w", version=version) as file:
        for name, size in SIZES.items():
            file.createDimension(name, size)
            axis = file.createVariable(name, "f8", (name,))
            axis[:], axis.units = np.arange(size), UNITS[name]
        for name, values in fields.items():
            variable = file.createVariable(name, values.dtype, tuple(SIZES))
            variable[:] = values
            for key, value in more.items():
                setattr(variable, key, value)
    return path


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize("dtype", ["int8", "int16", "int32", "float32", "float64"])
def test_a_variable_of_the_contest(tmp_path, version, dtype):
    """Longitude is x, latitude y by their units, and so radius is z.

    Whole numbers of more than a byte may never have been written, which only a float can say.
    """
    values = (100 * FIELD).clip(-128, 127).astype(dtype)
    fields = {"temperature": values[::-1], "temperature anomaly": values, "vx": values - 9}
    path = write_netcdf(tmp_path / "spherical001.nc", fields, version=version)
    source = open_source(path, variable="temperature anomaly")
    assert (source.dims, source.spacing, source.origin) == ((6, 4, 5), (1, 1, 1), (0, 0, 0))
    assert source.dtype == (np.float32 if dtype in ("int16", "int32") else dtype)
    assert source.dtype.isnative
    np.testing.assert_array_equal(source.slices(0, 5), values.transpose(1, 0, 2))
    np.testing.assert_array_equal(source.slices(1, 3), values.transpose(1, 0, 2)[1:3])


def write_axes(path, places, units, axes=("z", "y", "x"), field=FIELD):
    """Write a field with coordinates [n] of its dimensions, and their units."""
    with netcdf_file(path, "w") as file:
        for axis, along, unit in zip(axes, places, units, strict=True):
            file.createDimension(axis, len(along))
            variable = file.createVariable(axis, "f4", (axis,))
            variable[:], variable.units = along, unit
        file.createVariable("t", "f4", axes)[:] = field
    return path


def test_spacing_and_origin_are_those_of_coordinates_in_the_unit_of_x(tmp_path):
    places = (2 + 0.5 * np.arange(4), 100 * np.arange(5), -7 + 300 * np.arange(6))
    source = open_source(write_axes(tmp_path / "v.nc", places, ("km", "m", "meter")))
    assert (source.spacing, source.origin, source.note) == ((300, 100, 500), (-7, 0, 2000), "")
    assert source.space.unit == "meter"
    np.testing.assert_array_equal(source.slices(0, 4), FIELD)


def test_units_that_cannot_be_compared_are_told(tmp_path):
    path = write_axes(tmp_path / "v.nc", [np.arange(n) * 3 for n in (4, 5, 6)], ("hPa", "degrees", "degrees"))
    source = open_source(path)
    assert (source.spacing, source.origin, source.space.unit) == ((1, 1, 1), (0, 0, 0), "")
    assert source.note == "units along x, y, z are degrees, degrees, hPa, so that samples are 1 apart"


@pytest.mark.parametrize("told", [{"positive": "down", "units": "m"}, {"units": "hPa"}])
def test_what_counts_downwards_is_turned_upwards(tmp_path, told):
    """The surface, at depth 0, is the top; north stays north."""
    values = np.zeros((6, 8, 10), np.float32)
    values[0, 7, 9] = 1.0  # at the surface, north and east
    with netcdf_file(tmp_path / "sea.nc", "w") as file:
        for name, size in {"depth": 6, "lat": 8, "lon": 10}.items():
            file.createDimension(name, size)
            axis = file.createVariable(name, "f8", (name,))
            axis[:], axis.units = np.arange(size), "m"
        for key, value in told.items():
            setattr(file.variables["depth"], key, value)
        file.createVariable("t", "f4", ("depth", "lat", "lon"))[:] = values
    source = open_source(tmp_path / "sea.nc")
    assert np.argwhere(source.slices(0, 6) > 0).tolist() == [[5, 7, 9]]
    if "positive" in told:
        assert source.origin == (0.0, 0.0, -5.0)


def test_integers_that_are_said_to_have_no_sign(tmp_path):
    values = np.arange(120, dtype=np.uint8).reshape(4, 5, 6) + 100
    path = write_netcdf(tmp_path / "v.nc", {"t": values.view(np.int8)}, _Unsigned="true")
    source = open_source(path)
    assert source.dtype == np.uint8
    np.testing.assert_array_equal(source.slices(0, 5), values.transpose(1, 0, 2))
