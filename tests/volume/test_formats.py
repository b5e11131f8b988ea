import gzip

import h5py
import nibabel
import nrrd
import numpy as np
import pytest
import pyvista
import SimpleITK as sitk
import tifffile

from tests.volume.volume_files import (
    HAS_SPACING,
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
    moved = open_source(tmp_path / name, spacing=(7, 8, 9), origin=(1, 2, 3))
    assert (moved.spacing, moved.origin) == ((7, 8, 9), (1, 2, 3))


@pytest.mark.parametrize("name", ["plain.mha", "plain.mhd", "raw.nrrd", "raw.nhdr", "little.tif", "rows.npy"])
def test_plain_samples_in_a_file_are_read_slab_by_slab(tmp_path, name):
    WRITERS[name](tmp_path / name, sample_values())
    assert isinstance(open_source(tmp_path / name), RawSource)


ORIENTATIONS = ("RAS", "LAS", "LPS", "LPI", "SRA", "PIL", "AIR")


def stored_as(codes):
    """An image of right, anterior, superior, as it is stored with other axes, and what NIfTI makes of it."""
    values = sample_values("int16")
    affine = np.diag([2.0, 3.0, 4.0, 1.0])
    affine[:3, 3] = 10, 20, 30
    turn = nibabel.orientations.ornt_transform(
        nibabel.orientations.axcodes2ornt("RAS"), nibabel.orientations.axcodes2ornt(codes)
    )
    image = nibabel.Nifti1Image(values.T, affine).as_reoriented(turn)
    assert nibabel.aff2axcodes(image.affine) == tuple(codes)
    return image, np.asarray(image.dataobj).T, image.affine, values


@pytest.mark.parametrize("codes", ORIENTATIONS)
@pytest.mark.parametrize("suffix", [".nii", ".nii.gz"])
def test_nifti_axes_become_right_anterior_superior(tmp_path, codes, suffix):
    image, _, _, expected = stored_as(codes)
    nibabel.save(image, tmp_path / f"v{suffix}")
    assert_holds(tmp_path / f"v{suffix}", expected, (2, 3, 4), (10, 20, 30))


def test_nifti_scale_and_single_fourth_axis(tmp_path):
    image = nibabel.Nifti1Image(sample_values("int16").T[..., None], np.eye(4))
    image.header.set_slope_inter(0.5, -3)
    nibabel.save(image, tmp_path / "v.nii")
    source = open_source(tmp_path / "v.nii")
    assert source.dtype == np.float32
    np.testing.assert_allclose(source.slices(0, 11), sample_values() * 0.5 - 3)


def test_nifti_without_orientation_is_as_stored(tmp_path):
    """Method 1 of the standard. SimpleITK mirrors nothing either."""
    image = nibabel.Nifti1Image(sample_values("int16").T, None)
    image.header.set_zooms((0.5, 2.0, 3.0))
    image.header["sform_code"] = image.header["qform_code"] = 0
    nibabel.save(image, tmp_path / "v.nii")
    source = open_source(tmp_path / "v.nii")
    np.testing.assert_array_equal(source.slices(0, 11), sample_values("int16"))
    assert (source.spacing, source.note) == (
        (0.5, 2, 3),
        "NIfTI tells no orientation: axes are taken as stored",
    )
    itk = sitk.GetArrayFromImage(sitk.ReadImage(tmp_path / "v.nii"))
    np.testing.assert_array_equal(source.slices(0, 11), itk)


def test_files_that_macos_leaves_are_no_slices(tmp_path):
    for number in (8, 9):
        tifffile.imwrite(tmp_path / f"s{number}.tif", np.full((4, 5), number, np.uint8))
    (tmp_path / "._s8.tif").write_bytes(b"\0\5\x16\7")
    assert open_source(tmp_path).dims == (5, 4, 2)


@pytest.mark.parametrize("suffix", [".nii", ".nii.gz"])
@pytest.mark.parametrize("slope", [None, 0.5])
def test_a_step_of_nifti_with_an_axis_of_time(tmp_path, suffix, slope):
    first = sample_values("int16")
    steps = [first, first + 1, first[::-1] + 2]
    image = nibabel.Nifti1Image(np.stack([each.T for each in steps], axis=3), np.diag([-2, 3, 4, 1]))
    image.header.set_slope_inter(slope, None if slope is None else -3)
    nibabel.save(image, tmp_path / f"v{suffix}")
    for time, values in enumerate(steps):
        source = open_source(tmp_path / f"v{suffix}", time=time)
        assert (source.n_steps, source.spacing) == (3, (2, 3, 4))
        expected = values[:, :, ::-1] * (slope or 1) - (3 if slope else 0)
        np.testing.assert_allclose(source.slices(0, 11), expected)
    assert "step 2 of 3" in source.note
    with pytest.raises(ArgumentError, match=r"v\.nii.*: dataset.volume.time: expected one of 0 to 2, got 3"):
        open_source(tmp_path / f"v{suffix}", time=3)


def test_nrrd_space_directions_and_byte_skip(tmp_path):
    values = sample_values("uint8")
    header = "NRRD0005\ntype: uchar\ndimension: 3\nspace dimension: 3\nsizes: 13 12 11\nencoding: raw\n"
    header += "space directions: (3,4,0) (0,0,2) (1,0,0)\nspace origin: (1,2,3)\n"
    (tmp_path / "v.nhdr").write_text(header + "data file: v.bin\nbyte skip: -1\n")
    (tmp_path / "v.bin").write_bytes(b"some header" + values.tobytes())
    turned = values.transpose(1, 2, 0)  # x is along y, y along z, z along x
    assert_holds(tmp_path / "v.nhdr", turned, (1, 5, 2), (1, 2, 3))
    (tmp_path / "v.nhdr").write_text(header + "data file: v.bin\nline skip: 1\nbyte skip: 2\n")
    (tmp_path / "v.bin").write_bytes(b"line\n--" + values.tobytes())
    assert_holds(tmp_path / "v.nhdr", turned)
    (tmp_path / "v.bin").unlink()
    with pytest.raises(ArgumentError, match=r"no such file with samples: .*v\.bin"):
        open_source(tmp_path / "v.nhdr")


def test_nrrd_spacing_by_the_ends_of_axes(tmp_path):
    values = sample_values("uint8")
    header = "NRRD0005\ntype: uchar\ndimension: 3\nsizes: 13 12 11\nencoding: raw\n"
    header += "axis mins: 0 0 5\naxis maxs: 24 22 5.5\n"
    for centers, expected in (("", (2, 2, 0.05)), ("centers: cell node node\n", (24 / 13, 2, 0.05))):
        (tmp_path / "v.nrrd").write_bytes((header + centers + "\n").encode() + values.tobytes())
        np.testing.assert_allclose(open_source(tmp_path / "v.nrrd").spacing, expected)


@pytest.mark.parametrize("codes", ORIENTATIONS)
@pytest.mark.parametrize("space", ["right-anterior-superior", "left-anterior-superior"])
def test_nrrd_axes_become_those_of_space_and_nothing_is_mirrored(tmp_path, codes, space):
    """The same image by NIfTI and by NRRD, whichever way it is stored."""
    _, stored, affine, expected = stored_as(codes)
    if space.startswith("left"):
        affine = np.diag([-1.0, 1, 1, 1]) @ affine
    directions, origin = affine[:3, :3].T, affine[:3, 3]
    header = {"space": space, "space directions": directions, "space origin": origin, "encoding": "raw"}
    for encoding in ("raw", "gzip"):
        nrrd.write(str(tmp_path / "v.nrrd"), stored, header | {"encoding": encoding}, index_order="C")
        assert_holds(tmp_path / "v.nrrd", expected, (2, 3, 4), (10, 20, 30))


@pytest.mark.parametrize("codes", ORIENTATIONS)
def test_metaimage_axes_become_those_of_space(tmp_path, codes):
    """Its space is that of DICOM, left and posterior: a half turn from that of NIfTI, and no mirror of it."""
    _, stored, affine, expected = stored_as(codes)
    affine = np.diag([-1.0, -1, 1, 1]) @ affine
    steps = np.linalg.norm(affine[:3, :3], axis=0)
    words = {
        "NDims": [3],
        "DimSize": stored.shape[::-1],
        "ElementSpacing": steps,
        "TransformMatrix": (affine[:3, :3] / steps).T.ravel(),
        "Offset": affine[:3, 3],
    }
    lines = [f"{key} = {' '.join(map(str, numbers))}\n" for key, numbers in words.items()]
    head = "Comment = Schädel\n" + "".join(lines) + "ElementType = MET_SHORT\nElementDataFile = LOCAL\n"
    (tmp_path / "v.mha").write_bytes(head.encode() + stored.astype("<i2").tobytes())
    assert_holds(tmp_path / "v.mha", expected[:, ::-1, ::-1], (2, 3, 4))


def test_vti_axes_become_those_of_space(tmp_path):
    values = sample_values("uint8")
    image = image_data(values)
    image.SetDirectionMatrix(0, 0, -1, 1, 0, 0, 0, 1, 0)  # in columns: x is along y, y along z, z against x
    write_image(tmp_path / "v.vti", image)
    turned = values.transpose(1, 2, 0)[:, :, ::-1]
    assert_holds(tmp_path / "v.vti", turned, (SPACING[2], SPACING[0], SPACING[1]))


def test_metaimage_header_size_and_byte_order(tmp_path):
    values = sample_values(">i2")
    text = "NDims = 3\nDimSize = 13 12 11\nElementType = MET_SHORT\nElementByteOrderMSB = True\n"
    (tmp_path / "v.bin").write_bytes(b"some header" + values.tobytes())
    (tmp_path / "v.mhd").write_text(f"{text}Position = 1 2 3\nHeaderSize = -1\nElementDataFile = v.bin\n")
    source = open_source(tmp_path / "v.mhd")
    assert (source.dtype, source.spacing, source.origin) == (np.int16, (1, 1, 1), (1, 2, 3))
    np.testing.assert_array_equal(source.slices(0, 11), values)


def test_folder_of_tiffs_in_natural_order(tmp_path):
    values = sample_values()
    for z, page in enumerate(values):
        tifffile.imwrite(tmp_path / f"slice{z}.tif", page, compression="zlib" if z % 2 else None)
    (tmp_path / "notes.txt").write_text("not a slice")
    source = open_source(tmp_path, spacing=(1, 1, 2))
    assert (source.dims, source.spacing) == ((13, 12, 11), (1, 1, 2))
    np.testing.assert_array_equal(source.slices(8, 11), values[8:])
    tifffile.imwrite(tmp_path / "slice4.tif", values[0, :5])
    with pytest.raises(ArgumentError, match=r"slice4.tif: expected a page \[12, 13\] of uint16 as the first"):
        source.slices(0, 11)


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


def test_a_vti_file_of_several_arrays(tmp_path):
    image, path = pyvista.ImageData(dimensions=(3, 4, 5)), tmp_path / "v.vti"
    values = np.arange(60.0)
    image.point_data["velocity"] = np.stack([values] * 3, axis=1)
    image.point_data["p"], image.point_data["q"] = values, -values
    image.point_data.active_vectors_name = "velocity"
    image.save(path)
    source = open_source(path)
    assert source.note == "array p; dataset.volume.variable chooses another (q)"
    assert source.slices(0, 5).ravel().tolist() == values.tolist()
    chosen = open_source(path, variable="q")
    assert (chosen.note, chosen.slices(0, 5)[4, 3, 2]) == ("", -59)
    with pytest.raises(ArgumentError, match=r"variable: expected one of p, q, got velocity"):
        open_source(path, variable="velocity")


@pytest.mark.parametrize(
    "written",
    [
        {"imagej": True, "resolution": (2, 4), "metadata": {"spacing": -3.0, "unit": "um", "axes": "ZYX"}},
        {
            "ome": True,
            "metadata": {
                "axes": "ZYX",
                **{"PhysicalSizeX": 500, "PhysicalSizeXUnit": "nm"},
                **{"PhysicalSizeY": 0.25, "PhysicalSizeZ": 3.0},
            },
        },
    ],
)
def test_the_spacing_that_microscopes_write_into_tiff(tmp_path, written):
    values = np.arange(60, dtype=np.uint16).reshape(5, 4, 3)
    tifffile.imwrite(tmp_path / "a.tif", values, photometric="minisblack", **written)
    source = open_source(tmp_path / "a.tif")
    x, y, z = source.spacing
    assert (y / x, z / x) == pytest.approx((0.5, 6.0))
    assert source.note == ""
    np.testing.assert_array_equal(source.slices(0, 5), values)
    assert open_source(tmp_path / "a.tif", spacing=(1.0, 1.0, 2.0)).spacing == (1, 1, 2)


@pytest.mark.parametrize("name", ["v.mgz", "v.mgh", "v.img", "v.hdr"])
@pytest.mark.parametrize("codes", ORIENTATIONS[:3])
def test_other_images_of_the_brain_have_the_axes_of_nifti(tmp_path, name, codes):
    image, _, _, expected = stored_as(codes)
    kind = nibabel.MGHImage if name.startswith("v.m") else nibabel.Nifti1Pair
    nibabel.save(kind(np.asarray(image.dataobj), image.affine), tmp_path / name.replace("hdr", "img"))
    assert_holds(tmp_path / name, expected, (2, 3, 4), (10, 20, 30))
    assert open_source(tmp_path / name).note == ""


def test_analyze_tells_no_orientation(tmp_path):
    image = nibabel.AnalyzeImage(sample_values("int16").T, None)
    image.header.set_zooms((0.5, 2.0, 3.0))
    nibabel.save(image, tmp_path / "v.img")
    for name in ("v.img", "v.hdr"):
        assert_holds(tmp_path / name, sample_values("int16"), (0.5, 2, 3))
        assert open_source(tmp_path / name).note == "ANALYZE tells no orientation: axes are taken as stored"
        other = {".img": ".hdr", ".hdr": ".img"}[name[1:]]
        assert samples_of(tmp_path / name) == tmp_path / f"v{other}"


def test_one_array_of_an_archive_of_numpy(tmp_path):
    values = sample_values()
    np.savez_compressed(tmp_path / "one.npz", values)
    np.savez(tmp_path / "two.npz", a=values, b=values + 1)
    assert_holds(tmp_path / "one.npz", values)
    assert_holds(tmp_path / "two.npz", values + 1, variable="b")
    with pytest.raises(ArgumentError, match=r"dataset.volume.variable: expected one of a, b, got none$"):
        open_source(tmp_path / "two.npz")


@pytest.mark.parametrize("suffix", [".hdf", ".nxs", ".ims"])
def test_hdf5_has_other_names(tmp_path, suffix):
    with h5py.File(tmp_path / f"v{suffix}", "w") as file:
        for channel in range(2):
            file[f"DataSet/Channel {channel}/Data"] = sample_values() + channel
    assert_holds(tmp_path / f"v{suffix}", sample_values() + 1, variable="DataSet/Channel 1/Data")
    note = open_source(tmp_path / f"v{suffix}", variable="DataSet/Channel 1/Data").note
    assert note.startswith("Imaris pads arrays with zeros") is (suffix == ".ims")


@pytest.mark.parametrize("name", ["data\\Scan.raw", "data\\SCAN.RAW", "data/scan.raw"])
def test_names_of_windows_in_a_header(tmp_path, name):
    (tmp_path / "data").mkdir()
    sample_values().tofile(tmp_path / "data" / "Scan.raw")
    text = "NDims = 3\nDimSize = 13 12 11\nElementType = MET_USHORT\nElementDataFile = "
    (tmp_path / "v.mhd").write_text(text + name)
    assert_holds(tmp_path / "v.mhd", sample_values())
