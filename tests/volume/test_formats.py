"""Files of many formats against the arrays that other libraries wrote into them."""

import gzip

import nibabel
import numpy as np
import pytest
import tifffile

from tests.volume.volume_files import (
    HAS_SPACING,
    READ_ON_DEMAND,
    SPACING,
    WRITERS,
    assert_holds,
    image_data,
    sample_values,
    write_image,
)
from texgs.core.errors import ArgumentError
from texgs.volume.headers import samples_of
from texgs.volume.slabs import RawSource
from texgs.volume.sources import open_source


@pytest.mark.parametrize(
    "dtype", ["uint8", *(pytest.param(dtype, marks=pytest.mark.subprocess) for dtype in ("int16", "float32"))]
)
@pytest.mark.parametrize("name", WRITERS)
def test_round_trip(tmp_path, name, dtype):
    values = sample_values(dtype)
    WRITERS[name](tmp_path / name, values)
    source = open_source(tmp_path / name)
    assert (source.dims, source.dtype) == ((13, 12, 11), dtype)
    assert source.name.startswith(name.split(".")[0])
    assert source.spacing == (SPACING if name in HAS_SPACING else (1, 1, 1))
    assert source.origin == (0, 0, 0)
    np.testing.assert_array_equal(source.slices(0, 11), values)
    np.testing.assert_array_equal(source.slices(4, 6), values[4:6])
    assert isinstance(source, RawSource) is (name in READ_ON_DEMAND)
    moved = open_source(tmp_path / name, spacing=(7, 8, 9), origin=(1, 2, 3))
    assert (moved.spacing, moved.origin) == ((7, 8, 9), (1, 2, 3))


@pytest.mark.parametrize(
    ("name", "kind"),
    [("v.nii", nibabel.Nifti1Image), ("v.img", nibabel.AnalyzeImage), ("v.hdr", nibabel.AnalyzeImage)],
)
def test_brains_without_orientation_are_as_stored(tmp_path, name, kind):
    """Method 1 of the standard of NIfTI; nibabel would mirror them."""
    image = kind(sample_values("int16").T, None)
    image.header.set_zooms(SPACING)
    if kind is nibabel.Nifti1Image:
        image.header["sform_code"] = image.header["qform_code"] = 0
    nibabel.save(image, (tmp_path / name).with_suffix(".img" if name == "v.hdr" else name[1:]))
    assert_holds(tmp_path / name, sample_values("int16"), SPACING)
    assert open_source(tmp_path / name).note.endswith(" tells no orientation: axes are taken as stored")
    other = {"v.img": tmp_path / "v.hdr", "v.hdr": tmp_path / "v.img"}
    assert samples_of(tmp_path / name) == other.get(name)


@pytest.mark.parametrize("suffix", [".nii", ".nii.gz"])
@pytest.mark.parametrize(("slope", "offset"), [(None, None), (0.5, -3)])
@pytest.mark.parametrize("n_steps", [1, 3])
def test_steps_of_nifti_and_what_scales_them(tmp_path, suffix, slope, offset, n_steps):
    first = sample_values("int16")
    steps = [first, first + 1, first[::-1] + 2][:n_steps]
    image = nibabel.Nifti1Image(np.stack([each.T for each in steps], axis=3), np.diag([-2, 3, 4, 1]))
    image.header.set_slope_inter(slope, offset)
    nibabel.save(image, tmp_path / f"v{suffix}")
    for time, values in enumerate(steps):
        expected = values[:, :, ::-1] * (slope or 1) + (offset or 0)
        assert_holds(tmp_path / f"v{suffix}", expected, (2, 3, 4), time=time)
        note = f"step {time} of 3" if n_steps > 1 else ""
        assert open_source(tmp_path / f"v{suffix}", time=time).note.startswith(note)


HEAD = "NRRD0005\ntype: uchar\ndimension: 3\nsizes: 13 12 11\nencoding: raw\n"


def test_nrrd_space_directions_and_byte_skip(tmp_path):
    values = sample_values("uint8")
    header = f"{HEAD}space dimension: 3\nspace directions: (3,4,0) (0,0,2) (1,0,0)\nspace origin: (1,2,3)\n"
    turned = values.transpose(1, 2, 0)  # x is along y, y along z, z along x
    for skip, before in (("byte skip: -1", b"some header"), ("line skip: 1\nbyte skip: 2", b"line\n--")):
        (tmp_path / "v.nhdr").write_text(f"{header}data file: v.bin\n{skip}\n")
        (tmp_path / "v.bin").write_bytes(before + values.tobytes())
        assert_holds(tmp_path / "v.nhdr", turned, (1, 5, 2), (1, 2, 3))


def test_nrrd_spacing_by_the_ends_of_axes(tmp_path):
    header = f"{HEAD}axis mins: 0 0 5\naxis maxs: 24 22 5.5\n"
    for centers, expected in (("", (2, 2, 0.05)), ("centers: cell node node\n", (24 / 13, 2, 0.05))):
        (tmp_path / "v.nrrd").write_bytes(f"{header}{centers}\n".encode() + sample_values("uint8").tobytes())
        np.testing.assert_allclose(open_source(tmp_path / "v.nrrd").spacing, expected)


def test_metaimage_header_size_and_byte_order(tmp_path):
    values = sample_values(">i2")
    text = "NDims = 3\nDimSize = 13 12 11\nElementType = MET_SHORT\nElementByteOrderMSB = True\n"
    (tmp_path / "v.bin").write_bytes(b"some header" + values.tobytes())
    text = f"Comment = Schädel\n{text}Position = 1 2 3\nHeaderSize = -1\nElementDataFile = v.bin\n"
    (tmp_path / "v.mhd").write_text(text)
    assert_holds(tmp_path / "v.mhd", values, (1, 1, 1), (1, 2, 3))
    assert open_source(tmp_path / "v.mhd").dtype == np.int16


@pytest.mark.parametrize("name", ["data\\Scan.raw", "data\\SCAN.RAW", "data/scan.raw"])
def test_names_of_windows_in_a_header(tmp_path, name):
    (tmp_path / "data").mkdir()
    sample_values().tofile(tmp_path / "data" / "Scan.raw")
    text = "NDims = 3\nDimSize = 13 12 11\nElementType = MET_USHORT\nElementDataFile = "
    (tmp_path / "v.mhd").write_text(text + name)
    assert_holds(tmp_path / "v.mhd", sample_values())


def test_folder_of_tiffs_in_natural_order(tmp_path):
    values = sample_values()
    for z, page in enumerate(values):
        tifffile.imwrite(tmp_path / f"slice{z}.tif", page, compression="zlib" if z % 2 else None)
    (tmp_path / "notes.txt").write_text("not a slice")
    (tmp_path / "._slice8.tif").write_bytes(b"\0\5\x16\7")  # macOS leaves these
    assert_holds(tmp_path, values, (1, 1, 1))
    np.testing.assert_array_equal(open_source(tmp_path).slices(8, 11), values[8:])
    tifffile.imwrite(tmp_path / "slice4.tif", values[0, :5])
    with pytest.raises(ArgumentError, match=r"slice4.tif: expected a page \[12, 13\] of uint16 as the first"):
        open_source(tmp_path).slices(0, 11)


def test_vti_with_an_extent_that_starts_elsewhere(tmp_path):
    image = image_data(sample_values())
    image.SetExtent(2, 14, 3, 14, 4, 14)
    image.SetOrigin(10, 20, 30)
    write_image(tmp_path / "v.vti", image)
    assert open_source(tmp_path / "v.vti").origin == (10 + 2 * 0.5, 20 + 3 * 2.0, 30 + 4 * 3.0)


def test_whole_file_compression_is_told_from_the_suffix(tmp_path):
    WRITERS["plain.nii"](tmp_path / "plain.nii", sample_values())
    (tmp_path / "V.NII.GZ").write_bytes(gzip.compress((tmp_path / "plain.nii").read_bytes()))
    assert_holds(tmp_path / "V.NII.GZ", sample_values())


def test_one_array_of_an_archive_of_numpy(tmp_path):
    values = sample_values()
    np.savez_compressed(tmp_path / "one.npz", values)
    np.savez(tmp_path / "two.npz", a=values, b=values + 1)
    assert_holds(tmp_path / "one.npz", values)
    assert_holds(tmp_path / "two.npz", values + 1, variable="b")
