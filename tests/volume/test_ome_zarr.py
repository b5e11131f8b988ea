"""Zarr and OME-Zarr, written by Zarr, against NumPy arrays."""

import struct
from base64 import b64encode
from itertools import combinations

import numpy as np
import pytest
import zarr
from zarr.storage import LocalStore

from tests.volume.volume_files import assert_holds, sample_values, whole
from tests.volume.zarr_files import LABELS, add_image, all_axes, axes_of, write_image, zipped
from texgs.core.errors import ArgumentError
from texgs.volume.axes import Channel
from texgs.volume.sources import open_source

VALUES = sample_values()  # [11, 12, 13]
LEVELS, SCALES = [VALUES, VALUES[::2, ::2, ::2]], [(3, 2, 0.5), (6, 4, 1)]
VERSIONS = pytest.mark.parametrize("version", ["0.4", "0.5"])


@VERSIONS
@pytest.mark.parametrize("kind", ["folder", "zip", "folder in a zip"])
def test_the_finest_level_with_its_lattice(tmp_path, version, kind):
    shifts = [(30, 20, 10), (31.5, 21, 10.25)]
    path = write_image(tmp_path / "v.ome.zarr", LEVELS, axes_of("zyx"), SCALES, shifts, version=version)
    if kind != "folder":
        path = zipped(path, tmp_path / "v", inner=kind != "zip")
    source = open_source(path)
    assert (source.dims, source.dtype, source.note) == ((13, 12, 11), np.uint16, "")
    assert (source.spacing, source.origin) == ((0.5, 2, 3), (10, 20, 30))
    np.testing.assert_array_equal(source.slices(0, 11), VALUES)
    np.testing.assert_array_equal(source.slices(4, 6), VALUES[4:6])
    for variable in ("s1", "/s1/"):
        source = open_source(path, variable=variable)
        assert (source.spacing, source.origin) == ((1, 4, 6), (10.25, 21, 31.5))
        np.testing.assert_array_equal(source.slices(0, 6), LEVELS[1])


@VERSIONS
@pytest.mark.parametrize("names", ["".join(c) + "zyx" for n in range(3) for c in combinations("tc", n)])
def test_axes_in_every_order_that_is_legal(tmp_path, version, names):
    values = all_axes(VALUES)[tuple(slice(None) if name in names else 1 for name in "tczyx")]
    scale = [*[1] * (len(names) - 3), 3, 2, 0.5]
    path = write_image(tmp_path / "v.zarr", [values], axes_of(names), [scale], version=version)
    keys = {"time": 1} if "t" in names else {}
    keys |= {"channel": "1"} if "c" in names else {}
    source = open_source(path, **keys)
    assert source.spacing == (0.5, 2, 3)
    assert source.n_steps == (2 if "t" in names else 1)
    np.testing.assert_array_equal(source.slices(0, 11), VALUES + 110)


def test_axes_of_space_in_another_order_and_time_and_channels_by_type(tmp_path):
    values = all_axes(VALUES).transpose(0, 1, 4, 2, 3)
    axes = axes_of("tcxzy")
    axes[0]["name"], axes[1]["name"] = "frame", "stain"
    path = write_image(tmp_path / "v.zarr", [values], axes, [(1, 1, 0.5, 3, 2)])
    assert_holds(path, VALUES + 120, (0.5, 2, 3), channel="2", time=1)


def test_channels_by_label_or_number(tmp_path):
    values = all_axes(VALUES, steps=1)[0]
    path = write_image(tmp_path / "v.zarr", [values], axes_of("czyx"), [(1, 1, 1, 1)], labels=LABELS)
    for chosen, above in (("GFP", 10), ("2", 20), (0, 0)):
        assert_holds(path, VALUES + above, channel=chosen)
    for keys, got in (({}, "none"), ({"channel": "CY5"}, "CY5"), ({"channel": "3"}, "3")):
        with pytest.raises(ArgumentError, match=rf"one of 0 \(DAPI\), 1 \(GFP\), 2 \(RFP\), got {got}$"):
            open_source(path, **keys)
    path = write_image(tmp_path / "one.zarr", [values[:1]], axes_of("czyx"), [(1, 1, 1, 1)], labels=["GFP"])
    assert_holds(path, VALUES)


@pytest.mark.parametrize(
    "said",
    [
        {"label": "x"},
        {"label": "x", "color": "red", "window": {"start": 0, "end": 1}},
        {"label": "x", "color": "FF0000", "window": {"start": 5, "end": 5}},
    ],
)
def test_how_a_channel_is_shown_may_be_missing_or_senseless(tmp_path, said):
    whole = {"label": "y", "color": "0080ff", "window": {"min": 0, "max": 65535, "start": 10, "end": 90.5}}
    values = all_axes(VALUES, steps=1, channels=2)[0]
    path = write_image(tmp_path / "v.zarr", [values], axes_of("czyx"), [(1, 1, 1, 1)], labels=[said, whole])
    assert open_source(path, channel="0").channel == Channel("x")
    assert open_source(path, channel="y").channel == Channel("y", (0, 128 / 255, 1), (10, 90.5))


def test_units_of_length_become_that_of_x(tmp_path):
    units = ("meter", "millimeter", "micrometer")
    axes = [{"name": name, "type": "space", "unit": unit} for name, unit in zip("zyx", units, strict=True)]
    source = open_source(write_image(tmp_path / "v.zarr", [VALUES], axes, [(1, 2, 3)]))
    np.testing.assert_allclose(source.spacing, (3, 2000, 1e6))


def test_transforms_of_the_image_come_after_those_of_its_levels(tmp_path):
    more = {
        "coordinateTransformations": [
            {"type": "scale", "scale": [2, 3, 4]},
            {"type": "translation", "translation": [5, 6, 7]},
        ]
    }
    path = write_image(tmp_path / "v.zarr", [VALUES], axes_of("zyx"), [(1, 2, 3)], [(1, 1, 1)], more=more)
    source = open_source(path)
    assert (source.spacing, source.origin) == ((12, 6, 2), (4 + 7, 3 + 6, 2 + 5))


@pytest.mark.parametrize(
    ("free", "level"), [(2 * VALUES.nbytes, 0), (2 * VALUES.nbytes - 1, 1), (2 * LEVELS[1].nbytes - 1, 1)]
)
def test_the_finest_level_that_fits_half_of_the_memory_is_taken_or_else_the_last(
    tmp_path, monkeypatch, free, level
):
    path = write_image(tmp_path / "v.zarr", LEVELS, axes_of("zyx"), SCALES)
    monkeypatch.setattr("texgs.core.memory.free_memory", lambda: free)
    source = open_source(path)
    np.testing.assert_array_equal(source.slices(0, source.dims[2]), LEVELS[level])
    told = "level s1 of s0, s1, by the memory that is free; dataset.volume.variable=s0 takes the finest"
    assert source.note == (told if level else "")
    np.testing.assert_array_equal(whole(path, variable="s0"), VALUES)


def test_the_only_image_of_a_folder_of_images_and_its_labels_by_their_path(tmp_path):
    """A folder as bioformats2raw writes it."""
    path = tmp_path / "v.zarr"
    root = zarr.open_group(path, mode="w")
    image = root.create_group("0")
    add_image(image, LEVELS, axes_of("zyx"), SCALES)
    add_image(image.create_group("labels/cells"), [VALUES % 5], axes_of("zyx"), [SCALES[0]])
    root.create_group("OME").attrs["ome"] = {"version": "0.5", "series": ["0"]}
    assert_holds(path, VALUES)
    assert_holds(path, VALUES % 5, (0.5, 2, 3), variable="0/labels/cells")
    assert_holds(path, LEVELS[1], (1, 4, 6), variable="0/s1")
    add_image(root.create_group("1"), [VALUES], axes_of("zyx"), [SCALES[0]])
    with pytest.raises(ArgumentError, match=r"variable: expected .*, got none; choose one of 0, 1$"):
        open_source(path)
    with pytest.raises(
        ArgumentError, match=r"got 2; choose one of 0, 0/labels/cells, 0/labels/cells/s0, 0/s"
    ):
        open_source(path, variable="2")


@pytest.mark.parametrize("zarr_format", [2, 3])
def test_arrays_that_are_no_images(tmp_path, zarr_format):
    path = tmp_path / "a.zarr"
    zarr.create_array(path, data=VALUES, chunks=(4, 5, 6), zarr_format=zarr_format)
    np.testing.assert_array_equal(whole(path), VALUES)
    group = zarr.open_group(tmp_path / "g", mode="w", zarr_format=zarr_format)  # without a suffix
    group.create_array("a/density", data=VALUES)
    group.create_array("flat", data=VALUES[0])
    np.testing.assert_array_equal(whole(tmp_path / "g"), VALUES)
    group.create_array("b", data=VALUES + 1)
    with pytest.raises(ArgumentError, match=r"got none; choose one of a/density, b$"):
        open_source(tmp_path / "g")


@pytest.mark.parametrize("zarr_format", [2, 3])
def test_coordinates_and_packed_numbers_as_xarray_writes_them(tmp_path, zarr_format):
    group = zarr.open_group(tmp_path / "v.zarr", mode="w", zarr_format=zarr_format)

    def add(name, values, axes, **attributes):
        named = {"dimension_names": axes} if zarr_format == 3 else {}
        array = group.create_array(name, data=values, **named)
        array.attrs.update(attributes | ({"_ARRAY_DIMENSIONS": axes} if zarr_format == 2 else {}))

    add("lev", 9.0 - 3 * np.arange(11), ["lev"], units="m")
    add("lat", 2.0 * np.arange(12), ["lat"], units="m")
    add("lon", 0.5 * np.arange(13), ["lon"], units="m")
    add("t", VALUES, ["lev", "lat", "lon"], scale_factor=0.5, _FillValue=7)
    source = open_source(tmp_path / "v.zarr")
    assert (source.spacing, source.origin) == ((0.5, 2, 3), (0, 0, -21))
    np.testing.assert_array_equal(source.slices(0, 11), np.where(VALUES == 7, np.nan, 0.5 * VALUES)[::-1])
    group["t"].attrs["_FillValue"] = b64encode(struct.pack("<d", 9.0)).decode()  # that of a float in format 3
    np.testing.assert_array_equal(
        whole(tmp_path / "v.zarr"), np.where(VALUES == 9, np.nan, 0.5 * VALUES)[::-1]
    )


@pytest.mark.parametrize("axes", [{}, {"axes": ["t", "c", "z", "y", "x"]}])
def test_versions_before_0_4_tell_no_spacing(tmp_path, axes):
    group = zarr.open_group(tmp_path / "v.zarr", mode="w", zarr_format=2)
    group.create_array("0", data=all_axes(VALUES))
    group.attrs["multiscales"] = [
        {"version": "0.3" if axes else "0.1", "datasets": [{"path": "./0"}], **axes}
    ]
    source = open_source(tmp_path / "v.zarr", time=1, channel="2")
    assert source.spacing == (1, 1, 1)
    np.testing.assert_array_equal(source.slices(0, 11), VALUES + 120)


@pytest.mark.parametrize("name", ["zarr.json", "s0/zarr.json", "s0/c/0/0/0"])
@pytest.mark.parametrize("share", [0.0, 0.97])
def test_a_part_that_is_cut_off_is_refused_and_the_terminal_stays_clean(tmp_path, capfd, name, share):
    path = write_image(tmp_path / "v.zarr", [VALUES], axes_of("zyx"), [SCALES[0]])
    content = (path / name).read_bytes()
    (path / name).write_bytes(content[: int(share * len(content))])
    with pytest.raises(
        ArgumentError, match=r"v\.zarr: expected (a folder or zip of Zarr|an array that is w)"
    ):
        whole(path)
    assert capfd.readouterr() == ("", "")


def test_the_fill_value_of_xarray_in_format_2_is_missing(tmp_path):
    values = np.arange(120, dtype=np.float32).reshape(4, 5, 6)
    filled = np.where(values == 7, -9999, values)
    array = zarr.create_array(
        LocalStore(tmp_path / "v.zarr"), data=filled, zarr_format=2, fill_value=-9999, attributes={}
    )
    np.testing.assert_array_equal(open_source(tmp_path / "v.zarr").slices(0, 4), filled)
    array.attrs["_ARRAY_DIMENSIONS"] = ["z", "y", "x"]
    expected = np.where(values == 7, np.nan, values)
    np.testing.assert_array_equal(open_source(tmp_path / "v.zarr").slices(0, 4), expected)


@pytest.mark.parametrize("shards", [None, (4, 6, 8)])
def test_chunks_that_are_missing_are_told_and_ends_of_shards_are_none(tmp_path, shards):
    sizes = {"shape": (11, 12, 13), "chunks": (2, 6, 4), "shards": shards}
    array = zarr.create_array(tmp_path / "v.zarr", dtype="u2", **sizes)
    array[:] = np.arange(1, 11 * 12 * 13 + 1).reshape(11, 12, 13)
    assert open_source(tmp_path / "v.zarr").note == ""
    min(path for path in (tmp_path / "v.zarr").rglob("*") if path.name == "0" and path.is_file()).unlink()
    total = 3 * 2 * 2 if shards else 6 * 2 * 4
    told = f"1 of {total} chunks are not there and count as 0"
    assert open_source(tmp_path / "v.zarr").note == told
