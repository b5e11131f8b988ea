"""HDF5 and NetCDF-4, written by h5py and netCDF4, against NumPy arrays."""

import h5py
import numpy as np
import pytest
import xarray

import texgs
from tests.volume.volume_files import assert_holds, sample_values, whole
from texgs.core.errors import ArgumentError
from texgs.volume.prepare import prepare
from texgs.volume.sources import open_source

VALUES = sample_values()  # [11, 12, 13]


def write(path, **arrays):
    """Write arrays by their names, with two underscores for a slash."""
    with h5py.File(path, "w") as file:
        for name, values in arrays.items():
            file[name.replace("__", "/")] = values
    return path


def write_labelled(path, field=VALUES, **options):
    """Write an array whose axes have coordinates 0.5 apart."""
    with h5py.File(path, "w") as file:
        array = file.create_dataset("a/density", data=field, **options)
        for axis, name in enumerate("zyx"):
            file[name] = 0.5 * np.arange(field.shape[axis])
            file[name].make_scale(name)
            array.dims[axis].attach_scale(file[name])


@pytest.mark.parametrize("dtype", ["bool", "uint8", ">i2", "int64", "float16", "float32", ">f8"])
@pytest.mark.parametrize("suffix", ["h5", "nc4", "nxs"])
def test_the_only_array_with_three_axes_needs_no_name(tmp_path, suffix, dtype):
    values = VALUES.astype(dtype)
    path = write(tmp_path / f"v.{suffix}", a__b__density=values, table=values[0], name="text", one=1.5)
    assert_holds(path, values, (1, 1, 1), (0, 0, 0))
    assert open_source(path).dtype == np.dtype(dtype).newbyteorder("=")
    assert open_source(path).note == ""
    np.testing.assert_array_equal(open_source(path).slices(4, 6), values[4:6])


def test_one_of_several_is_chosen_by_its_path_with_or_without_a_slash(tmp_path):
    arrays = {"DataSet__Channel 0__Data": VALUES, "DataSet__Channel 1__Data": VALUES + 1}
    path = write(tmp_path / "v.ims", flat=VALUES[0], wave=VALUES + 1j, **arrays)
    for variable in ("DataSet/Channel 1/Data", "/DataSet/Channel 1/Data"):
        assert_holds(path, VALUES + 1, variable=variable)
        assert open_source(path, variable=variable).note.startswith("Imaris pads arrays with zeros")


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


def missing(where, values=VALUES):
    return np.where(where, np.nan, values)


V, FILL = VALUES, "_FillValue"
CODED = [
    # Zero is a fill value, and an offset.
    (
        "u2",
        {FILL: np.uint16(0), "add_offset": 0.0, "scale_factor": np.array([2.0])},
        missing(V == 0, 2.0 * V),
    ),
    ("f4", {FILL: np.float64(7) + 1e-9}, missing(V == 7)),  # as h5py writes a number of Python
    ("i4", {"missing_value": np.array([3.0, 5.0])}, missing((V == 3) | (V == 5))),
    ("f4", {"missing_value": "7", FILL: np.float64(3)}, missing((V == 3) | (V == 7))),
    ("i4", {"valid_range": np.array([2.0, 90.0])}, missing((V < 2) | (V > 90))),
    ("f4", {"valid_min": 4}, missing(V < 4)),
    ("i4", {"valid_max": "8e1"}, missing(V > 80)),
    # A range of whole numbers is of packed samples, and one end of it, too.
    (
        "i2",
        {"scale_factor": "0.5", "add_offset": "10", "valid_range": np.array([4, 90])},
        missing((V < 4) | (V > 90), 10 + 0.5 * V),
    ),
    (
        "i2",
        {"scale_factor": -0.5, "add_offset": 10.0, "valid_min": np.int16(40)},
        missing(V < 40, 10 - 0.5 * V),
    ),
]


@pytest.mark.parametrize(("dtype", "said", "expected"), CODED)
def test_samples_are_those_that_attributes_of_cf_say(tmp_path, dtype, said, expected):
    path = write(tmp_path / "v.h5", v=VALUES.astype(dtype))
    with h5py.File(path, "a") as file:
        file["v"].attrs.update(said)
    np.testing.assert_array_equal(whole(path), expected)


@pytest.fixture
def read(monkeypatch):
    """First slice and the one after the last of each layer of /v that h5py reads, in order."""
    layers, item = [], h5py.Dataset.__getitem__

    def get(self, at):
        if self.name == "/v":
            layers.append(at[0].indices(11)[:2])
        return item(self, at)

    monkeypatch.setattr(h5py.Dataset, "__getitem__", get)
    return layers


@pytest.mark.parametrize("chunks", [(1, 12, 13), (4, 5, 6), (11, 2, 2)])
@pytest.mark.parametrize("is_turned", [False, True])
def test_every_chunk_is_read_once_and_no_more_than_a_layer_at_a_time(
    tmp_path, monkeypatch, read, chunks, is_turned
):
    monkeypatch.setattr("texgs.volume.slabs.SLAB_BYTES", 1)
    monkeypatch.setattr("texgs.volume.layers.SLAB_BYTES", 1)
    path = tmp_path / "v.h5"
    with h5py.File(path, "w") as file:
        array = file.create_dataset("v", data=VALUES, chunks=chunks)
        file["z"] = np.arange(11.0)[:: -1 if is_turned else 1]
        file["z"].make_scale("z")
        array.dims[0].attach_scale(file["z"])
    prepare(open_source(path), tmp_path / "v.nrrd", reduce=2)
    expected = [(low, min(low + chunks[0], 11)) for low in range(0, 11, chunks[0])]
    assert read == expected[:: -1 if is_turned else 1]


@pytest.mark.parametrize("planes", [1, 3])
def test_a_layer_takes_a_quarter_of_the_free_memory_at_most(tmp_path, monkeypatch, read, planes):
    with h5py.File(tmp_path / "v.h5", "w") as file:
        file.create_dataset("v", data=VALUES, chunks=(11, 4, 4))
    monkeypatch.setattr("texgs.volume.layers.free_memory", lambda: 4 * planes * VALUES[0].nbytes + 3)
    np.testing.assert_array_equal(whole(tmp_path / "v.h5"), VALUES)
    assert read == [(low, min(low + planes, 11)) for low in range(0, 11, planes)]


def test_a_filter_that_is_not_there_names_the_package(tmp_path, monkeypatch):
    with h5py.File(tmp_path / "v.h5", "w") as file:
        file.create_dataset("v", data=VALUES, chunks=(4, 5, 6), compression="gzip")
    np.testing.assert_array_equal(whole(tmp_path / "v.h5"), VALUES)
    monkeypatch.setattr("h5py.h5z.filter_avail", lambda code: False)
    with pytest.raises(
        ArgumentError, match="expected samples packed by gzip, got another filter; pip install hdf5plugin"
    ):
        open_source(tmp_path / "v.h5")


def write_virtual(folder):
    """Three parts of four slices each, in files beside that of the whole."""
    layout = h5py.VirtualLayout((12, 12, 13), "u2")
    values = np.concatenate([VALUES, VALUES[:1]])
    for k in range(3):
        write(folder / f"part{k}.h5", data=values[4 * k : 4 * k + 4])
        layout[4 * k : 4 * k + 4] = h5py.VirtualSource(f"part{k}.h5", "data", (4, 12, 13))
    with h5py.File(folder / "whole.h5", "w") as file:
        file.create_virtual_dataset("entry/data", layout)
        file["again"] = h5py.ExternalLink("whole.h5", "entry/data")
    return folder / "whole.h5", values


def test_a_virtual_array_needs_all_of_its_parts(tmp_path):
    path, values = write_virtual(tmp_path)
    np.testing.assert_array_equal(whole(path), values)
    for spoil in (lambda part: write(part, other=VALUES[:4]), lambda part: part.unlink()):
        spoil(tmp_path / "part1.h5")
        with pytest.raises(
            ArgumentError, match=r"/entry/data: expected its part data of part1\.h5, which is"
        ):
            open_source(path)


def test_arrays_behind_links_are_found_once_and_those_that_are_missing_are_told(tmp_path):
    path = tmp_path / "v.h5"
    write(tmp_path / "far.h5", data=VALUES, deep__inner=VALUES + 1)
    with h5py.File(path, "w") as file:
        file["entry/frames"] = h5py.ExternalLink("far.h5", "data")
        file["entry/default"] = h5py.SoftLink("/entry/frames")
        file["entry/cycle"] = h5py.SoftLink("/entry")
        file["entry/more"] = h5py.ExternalLink("far.h5", "deep")
        file["entry/lost"] = h5py.ExternalLink("gone.h5", "data")
    for variable in ("entry/frames", "entry/default"):
        assert_holds(path, VALUES, variable=variable)
    assert_holds(path, VALUES + 1, variable="entry/more/inner")
    assert (
        open_source(path, variable="entry/frames").note == "entry/lost links to gone.h5, which is not there"
    )
    with pytest.raises(ArgumentError, match=r"entry/lost links to gone\.h5, which is not there; put it"):
        open_source(path, variable="entry/lost")


def test_chunks_that_were_never_written_are_told(tmp_path):
    with h5py.File(tmp_path / "v.h5", "w") as file:
        array = file.create_dataset("v", VALUES.shape, "u2", chunks=(1, 12, 13), fillvalue=5)
        array[:4] = VALUES[:4]
    source = open_source(tmp_path / "v.h5")
    assert source.note == "7 of 11 chunks are not there and count as 5"
    np.testing.assert_array_equal(source.slices(3, 5), [VALUES[3], np.full((12, 13), 5)])


def test_points_of_netcdf_that_were_never_written_are_missing(tmp_path):
    netCDF4 = pytest.importorskip("netCDF4", reason="netCDF4, which writes the file, is not installed")
    for dtype in ("f4", "f8", "i2", "i4"):
        path = tmp_path / f"{dtype}.nc"
        with netCDF4.Dataset(path, "w") as file:
            for name, size in zip("zyx", VALUES.shape, strict=True):
                file.createDimension(name, size)
            file.createVariable("t", dtype, ("z", "y", "x"))[:9] = VALUES[:9]
        np.testing.assert_array_equal(whole(path)[:9], VALUES[:9])
        assert np.isnan(whole(path)[9:]).all()


def test_a_file_that_another_program_writes(tmp_path, monkeypatch):
    path = write(tmp_path / "v.h5", v=VALUES)
    monkeypatch.setattr("h5py.File", lambda *a, **k: (_ for _ in ()).throw(BlockingIOError(11, "locked")))
    with pytest.raises(ArgumentError, match="got one that is locked; close it there, or set HDF5_USE_FILE_L"):
        open_source(path)


@pytest.mark.parametrize(
    ("names", "attributes", "order"),
    [
        (("lon", "lat", "lev"), ({}, {}, {}), (2, 1, 0)),
        (("p", "q", "r"), ({"axis": "X"}, {"axis": "Y"}, {"axis": "Z"}), (2, 1, 0)),
        (("p", "q", "r"), ({"units": "degrees_north"}, {"units": "degrees_east"}, {}), (2, 0, 1)),
        (("p", "q", "r"), ({"standard_name": "projection_x_coordinate"}, {"axis": "Y"}, {}), (2, 1, 0)),
        (("northing", "q", "r"), ({"axis": "Y"}, {"positive": "up"}, {}), (1, 0, 2)),
        (("x", "y", "other"), ({}, {}, {}), (2, 1, 0)),
        (("depth", "height", "width"), ({}, {}, {}), (0, 1, 2)),
        (("p", "q", "r"), ({}, {}, {}), (0, 1, 2)),
        (("frames", "height", "width"), ({}, {}, {}), "frames, height, width are taken for z, y, x"),
        (("p", "q", "r"), ({}, {"axis": "Z"}, {}), "axes p, q, r are taken for z, y, x, as they are stored"),
    ],
)
def test_axes_are_those_of_their_attributes_or_names(tmp_path, names, attributes, order):
    """`order`: places of z, y, x among the axes as they are stored; or what is told of a guess."""
    values = VALUES[:4, :5, :6]
    with h5py.File(tmp_path / "v.h5", "w") as file:
        array = file.create_dataset("v", data=values)
        for k, (name, more) in enumerate(zip(names, attributes, strict=True)):
            file[name] = np.arange(values.shape[k], dtype=float)
            file[name].make_scale(name)
            file[name].attrs.update(more)
            array.dims[k].attach_scale(file[name])
    source = open_source(tmp_path / "v.h5")
    guess, order = (order, (0, 1, 2)) if isinstance(order, str) else ("", order)
    assert guess in source.note
    assert bool(guess) == ("are taken for" in source.note)
    np.testing.assert_array_equal(source.slices(0, source.dims[2]), values.transpose(order))
    places = {
        name: (name, np.arange(n), more)
        for name, n, more in zip(names, values.shape, attributes, strict=True)
    }
    volume = texgs.Volume(xarray.DataArray(values, places, names))
    np.testing.assert_array_equal(volume.grid.values, values.transpose(order))
