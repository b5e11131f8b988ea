"""HDF5 and NetCDF-4, written by h5py and netCDF4, against NumPy arrays."""

import h5py
import numpy as np
import pytest

from tests.volume.volume_files import sample_values, whole
from texgs.core.errors import ArgumentError, OutOfMemoryError
from texgs.volume.prepare import prepare
from texgs.volume.sources import open_source

VALUES = sample_values()  # [11, 12, 13]


def write(path, **arrays):
    """Write arrays by their names, with two underscores for a slash."""
    with h5py.File(path, "w") as file:
        for name, values in arrays.items():
            file[name.replace("__", "/")] = values
    return path


@pytest.mark.parametrize("dtype", ["bool", "uint8", ">i2", "int64", "float16", "float32", ">f8"])
@pytest.mark.parametrize("suffix", ["h5", "hdf5", "nc", "nc4"])
def test_the_only_array_with_three_axes_needs_no_name(tmp_path, suffix, dtype):
    values = VALUES.astype(dtype)
    path = write(tmp_path / f"v.{suffix}", a__b__density=values, table=values[0], name="text", one=1.5)
    source = open_source(path)
    assert (source.dims, source.dtype) == ((13, 12, 11), np.dtype(dtype).newbyteorder("="))
    assert (source.spacing, source.origin, source.note) == ((1, 1, 1), (0, 0, 0), "")
    np.testing.assert_array_equal(source.slices(0, 11), values)
    np.testing.assert_array_equal(source.slices(4, 6), values[4:6])


def test_one_of_several_is_chosen_by_its_path_with_or_without_a_slash(tmp_path):
    path = write(tmp_path / "v.h5", a__t=VALUES, a__u=VALUES + 1, flat=VALUES[0], wave=VALUES + 1j)
    for variable in ("a/u", "/a/u"):
        np.testing.assert_array_equal(whole(path, variable=variable), VALUES + 1)
    expected = r"dataset\.volume\.variable: expected an array of real numbers with three axes or more, got "
    for variable, got in {
        None: "none",
        "b": "b",
        "a": "a",
        "flat": "flat of 12 x 13 uint16",
        "wave": "wave of 11 x 12 x 13 complex128",
    }.items():
        with pytest.raises(ArgumentError, match=f"{expected}{got}; choose one of a/t, a/u$"):
            open_source(path, variable=variable)


@pytest.mark.parametrize(
    "arrays", [{}, {"a": VALUES[0]}, {"a": 3.0}, {"a": h5py.Empty("f4")}, {"a": VALUES[:0]}]
)
def test_a_file_without_an_array_of_three_axes(tmp_path, arrays):
    with pytest.raises(ArgumentError, match=r"with three axes or more, got none; choose one of another file"):
        open_source(write(tmp_path / "v.h5", **arrays))


def test_a_message_lists_some_of_many_arrays(tmp_path):
    path = write(tmp_path / "v.h5", **{f"step{k:02}": VALUES for k in range(20)})
    with pytest.raises(ArgumentError, match=r"choose one of step00, .*, step07 and 12 more"):
        open_source(path)


@pytest.mark.parametrize(
    ("shape", "keys", "index"),
    [
        ((2, 4, 5, 6), {"time": 1}, (1,)),
        ((2, 4, 5, 6), {}, (0,)),
        ((2, 3, 4, 5, 6), {"time": 1, "channel": "2"}, (1, 2)),
        ((4, 5, 6, 3), {"channel": 2}, (..., 2)),
        ((1, 4, 5, 6, 1), {}, (0, ..., 0)),
    ],
)
def test_axes_without_names_are_time_channel_z_y_x_or_components_at_the_end(tmp_path, shape, keys, index):
    values = np.random.default_rng(0).normal(size=shape)
    np.testing.assert_array_equal(whole(write(tmp_path / "v.h5", v=values), **keys), values[index])


def test_channels_have_to_be_chosen(tmp_path):
    path = write(tmp_path / "v.h5", v=np.zeros((4, 5, 6, 3)))
    for keys, got in (
        ({}, "none"),
        ({"channel": "3"}, "3"),
        ({"channel": "red"}, "red"),
        ({"channel": "-1"}, "-1"),
    ):
        with pytest.raises(ArgumentError, match=rf"channel: expected one of 0 to 2, got {got}$"):
            open_source(path, **keys)


def test_more_axes_of_space_than_three(tmp_path):
    path = write(tmp_path / "v.h5", v=np.zeros((2, 3, 4, 5)))
    with h5py.File(path, "a") as file:
        for axis, name in zip(file["v"].dims, ("member", "z", "y", "x"), strict=True):
            axis.label = name
    with pytest.raises(ArgumentError, match=r"three axes of space .*, got member 2 x z 3 x y 4 x x 5"):
        open_source(path)


@pytest.mark.parametrize("chunks", [None, (1, 12, 13), (4, 5, 6), (11, 3, 3)])
def test_packed_numbers_and_coordinates_of_netcdf_4(tmp_path, chunks):
    netCDF4 = pytest.importorskip("netCDF4", reason="netCDF4, which writes the file, is not installed")
    stored = VALUES.astype(np.int16)
    places = {"lev": 5 - 0.25 * np.arange(11), "y": 200.0 * np.arange(12), "x": 7 + 100.0 * np.arange(13)}
    with netCDF4.Dataset(tmp_path / "v.nc", "w") as file:
        file.createDimension("time", None)
        for name, along in places.items():
            file.createDimension(name, len(along))
            axis = file.createVariable(name, "f8", (name,))
            axis[:], axis.units = along, "km" if name == "lev" else "m"
        options = {"chunksizes": (1, *chunks)} if chunks else {}
        field = file.createGroup("run").createVariable("t", "i2", ("time", *places), fill_value=7, **options)
        field.set_auto_maskandscale(False)
        field.scale_factor, field.add_offset = 0.5, 100.0
        field[:] = np.stack([stored, stored + 1])
    source = open_source(tmp_path / "v.nc")
    assert (source.spacing, source.origin, source.dtype) == ((100, 200, 250), (7, 0, 2500), np.float32)
    assert source.note == "step 0 of 2; dataset.volume.time chooses another"
    np.testing.assert_array_equal(
        source.slices(0, 11), np.where(stored == 7, np.nan, 100 + 0.5 * stored)[::-1].astype(np.float32)
    )


def test_zero_is_a_fill_value_and_an_offset(tmp_path):
    path = write(tmp_path / "v.h5", v=VALUES)
    with h5py.File(path, "a") as file:
        file["v"].attrs.update(
            {"_FillValue": np.uint16(0), "add_offset": 0.0, "scale_factor": np.array([2.0])}
        )
    np.testing.assert_array_equal(whole(path), np.where(VALUES == 0, np.nan, 2.0 * VALUES))


def test_a_fill_value_with_more_digits_than_samples(tmp_path):
    """As h5py writes a number of Python."""
    stored = np.where(VALUES == 0, -999.9, VALUES).astype(np.float32)
    path = write(tmp_path / "v.h5", v=stored)
    with h5py.File(path, "a") as file:
        file["v"].attrs["_FillValue"] = -999.9
    np.testing.assert_array_equal(whole(path), np.where(VALUES == 0, np.nan, stored))


@pytest.mark.parametrize("chunks", [(1, 12, 13), (4, 5, 6), (3, 12, 13), (11, 2, 2)])
@pytest.mark.parametrize("is_turned", [False, True])
def test_every_chunk_is_read_once_and_no_more_than_a_layer_at_a_time(
    tmp_path, monkeypatch, chunks, is_turned
):
    monkeypatch.setattr("texgs.volume.slabs.SLAB_BYTES", 1)
    monkeypatch.setattr("texgs.volume.layers.SLAB_BYTES", 1)
    path = tmp_path / "v.h5"
    with h5py.File(path, "w") as file:
        array = file.create_dataset("v", data=VALUES, chunks=chunks)
        file["z"] = np.arange(11.0)[:: -1 if is_turned else 1]
        file["z"].make_scale("z")
        array.dims[0].attach_scale(file["z"])
    read = []
    item = h5py.Dataset.__getitem__
    monkeypatch.setattr(
        h5py.Dataset, "__getitem__", lambda self, at: read.append((self.name, at)) or item(self, at)
    )
    prepare(open_source(path), tmp_path / "v.nrrd", reduce=2)
    layers = [at[0].indices(11)[:2] for name, at in read if name == "/v"]
    expected = [(low, min(low + chunks[0], 11)) for low in range(0, 11, chunks[0])]
    assert layers == expected[:: -1 if is_turned else 1]


def test_a_layer_takes_a_quarter_of_the_free_memory_at_most(tmp_path, monkeypatch):
    path = tmp_path / "v.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("v", data=VALUES, chunks=(11, 4, 4))
    read, item = [], h5py.Dataset.__getitem__
    monkeypatch.setattr(h5py.Dataset, "__getitem__", lambda self, at: read.append(at[0]) or item(self, at))
    for planes in (1, 3):
        monkeypatch.setattr("texgs.volume.layers.free_memory", lambda n=planes: 4 * n * VALUES[0].nbytes + 3)
        np.testing.assert_array_equal(whole(path), VALUES)
        assert read == [slice(low, min(low + planes, 11)) for low in range(0, 11, planes)]
        read.clear()


def test_a_plane_that_does_not_fit_into_memory(tmp_path):
    with h5py.File(tmp_path / "v.h5", "w") as file:
        file.create_dataset("v", (4, 3_000_000, 3_000_000), "f4", chunks=(1, 1000, 1000))
    with pytest.raises(OutOfMemoryError, match="3000000 x 3000000 x 1 samples of float32: needs 33528 GiB"):
        open_source(tmp_path / "v.h5")


def test_a_filter_that_is_not_there_names_the_package(tmp_path, monkeypatch):
    with h5py.File(tmp_path / "v.h5", "w") as file:
        file.create_dataset("v", data=VALUES, chunks=(4, 5, 6), compression="gzip")
    np.testing.assert_array_equal(whole(tmp_path / "v.h5"), VALUES)
    monkeypatch.setattr("h5py.h5z.filter_avail", lambda code: False)
    with pytest.raises(
        ArgumentError, match="expected samples packed by gzip, got another filter; pip install hdf5plugin"
    ):
        open_source(tmp_path / "v.h5")


@pytest.mark.parametrize("share", [0.0, 0.02, 0.3, 0.6, 0.97])
def test_a_file_that_is_cut_off_is_refused_and_the_terminal_stays_clean(tmp_path, capfd, share):
    path = write(tmp_path / "v.h5", v=VALUES)
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    with pytest.raises(
        ArgumentError, match=r"v\.h5: expected an HDF5 or NetCDF file, got .*damaged or cut off"
    ):
        whole(path)
    assert capfd.readouterr() == ("", "")
