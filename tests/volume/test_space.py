"""What leaves texgs lies where the file lay: shown by SimpleITK, for oblique and mirrored axes."""

import locale
from functools import partial

import nibabel
import nrrd
import numpy as np
import pytest
import SimpleITK as sitk
from scipy.ndimage import center_of_mass

from texgs.volume.nrrd_file import open_grid
from texgs.volume.prepare import prepare, prepare_channels
from texgs.volume.sources import open_source

DIMS, SPACING, FIRST = (23, 19, 27), np.array([1.5, 2.0, 0.75]), np.array([-31.0, 44.0, 12.5])
MIDDLE, WIDTHS = np.array([13.0, 8.0, 9.0]), np.array([2.0, 1.2, 2.6])  # of the blob, samples
AXES = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0].T  # of samples, in rows, in LPS
ORIENTED = {
    "oblique": AXES * np.linalg.det(AXES),
    "oblique and mirrored": -AXES * np.linalg.det(AXES),
    "permuted and mirrored": np.array([[0.0, 0, -1], [1, 0, 0], [0, 1, 0]]),
}
TO_RAS = np.diag([-1.0, -1, 1])
TO_LAS = np.diag([1.0, -1, 1])


def blob():
    """A blob off the centre [Z, Y, X], on a background of 0."""
    z, y, x = np.indices(DIMS[::-1])
    places = np.stack([x, y, z], axis=-1)
    values = 1000 * np.exp(-((((places - MIDDLE) / WIDTHS) ** 2).sum(-1)))
    return np.where(values > 20, values, 0).astype(np.int16)


def by_itk(path, axes, is_compressed=False):
    image = sitk.GetImageFromArray(blob())
    image.SetSpacing(SPACING.tolist())
    image.SetOrigin(FIRST.tolist())
    image.SetDirection(axes.T.ravel().tolist())
    sitk.WriteImage(image, str(path), is_compressed)


def by_nibabel(path, axes):
    affine = np.eye(4)
    affine[:3, :3], affine[:3, 3] = TO_RAS @ (axes * SPACING[:, None]).T, TO_RAS @ FIRST
    nibabel.save(nibabel.Nifti1Image(blob().T, affine), path)


def by_pynrrd(path, axes, space="RAS", turn=TO_RAS):
    """In a space that runs to the right and the front, or to the left and the front."""
    directions = (axes * SPACING[:, None]) @ turn
    header = {"space": space, "space directions": directions, "space origin": turn @ FIRST}
    nrrd.write(str(path), blob(), header, index_order="C")


def left_handed(path, axes):
    """In a space of which nobody knows more, so that readers take its numbers as they are."""
    header = {"space": "3D-left-handed", "space directions": axes * SPACING[:, None], "space origin": FIRST}
    nrrd.write(str(path), blob(), header, index_order="C")


def dicom(folder, axes):
    """Slices behind each other, which DICOM cannot have mirrored: the last axis is that of the others."""
    folder.mkdir()
    axes = np.stack([*axes[:2], np.cross(*axes[:2])])
    kept = locale.setlocale(locale.LC_CTYPE)  # GDCM makes it C, and Python reads text by it
    writer = sitk.ImageFileWriter()
    writer.KeepOriginalImageUIDOn()
    for k, plane in enumerate(blob()):
        image = sitk.GetImageFromArray(plane[None])
        image.SetSpacing(SPACING.tolist())
        for tag, value in {
            "0008|0060": "CT",
            "0020|000e": "1.2.3.4",
            "0008|0018": f"1.2.3.4.{k + 1}",
            "0020|0013": str(k),
            "0020|0032": "\\".join(f"{each:.9f}" for each in FIRST + k * SPACING[2] * axes[2]),
            "0020|0037": "\\".join(f"{each:.12f}" for each in axes[:2].ravel()),
        }.items():
            image.SetMetaData(tag, value)
        writer.SetFileName(str(folder / f"{k:03}.dcm"))
        writer.Execute(image)
    locale.setlocale(locale.LC_CTYPE, kept)


WRITERS = {
    "v.nii.gz": (by_nibabel, "right-anterior-superior", "mm"),
    "v.nii": (by_nibabel, "right-anterior-superior", "mm"),
    "v.hdr": (by_nibabel, "right-anterior-superior", "mm"),
    "v.mgz": (by_nibabel, "right-anterior-superior", "mm"),
    "v.nrrd": (by_itk, "left-posterior-superior", "mm"),
    "ras.nrrd": (by_pynrrd, "right-anterior-superior", "mm"),
    "las.nrrd": (partial(by_pynrrd, space="LAS", turn=TO_LAS), "right-anterior-superior", "mm"),
    "left.nrrd": (left_handed, "3D-left-handed", ""),
    "v.mha": (by_itk, "left-posterior-superior", "mm"),
    "v.mhd": (partial(by_itk, is_compressed=True), "left-posterior-superior", "mm"),
    "slices": (dicom, "left-posterior-superior", "mm"),
}


OTHERS = [name for name in WRITERS if name not in ("v.nii.gz", "v.mgz")]


def read_by_itk(path):
    """An image as SimpleITK reads it, in LPS."""
    if path.suffix == ".mgz":  # which it does not
        nibabel.save(nibabel.load(path), path.with_suffix(".nii"))
        path = path.with_suffix(".nii")
    if not path.is_dir():
        return sitk.ReadImage(str(path))
    reader = sitk.ImageSeriesReader()
    reader.SetFileNames(reader.GetGDCMSeriesFileNames(str(path)))
    return reader.Execute()


def center_by_itk(path):
    """The centre of mass of an image, in LPS."""
    image = read_by_itk(path)
    middle = center_of_mass(sitk.GetArrayFromImage(image).astype(float))[::-1]
    return np.array(image.TransformContinuousIndexToPhysicalPoint(middle))


@pytest.mark.parametrize("oriented", ORIENTED)
@pytest.mark.parametrize(
    "name",
    ["v.nii.gz", "v.mgz", *(pytest.param(name, marks=pytest.mark.subprocess) for name in OTHERS)],
)
def test_a_prepared_volume_lies_where_its_file_lay(tmp_path, name, oriented):
    write, space, unit = WRITERS[name]
    write(tmp_path / name, ORIENTED[oriented])
    expected = center_by_itk(tmp_path / name)
    if name == "v.nrrd":  # the oracle is right itself
        ours = FIRST + (center_of_mass(blob().astype(float))[::-1] * SPACING) @ ORIENTED[oriented]
        np.testing.assert_allclose(expected, ours, atol=1e-9)
    source, target = open_source(tmp_path / name), tmp_path / "volume.nrrd"
    assert (source.space.name, source.space.unit) == (space, unit)
    for up in ("+y", "+z", "-x"):
        prepare(source, target, up=up)
        np.testing.assert_allclose(center_by_itk(target), expected, atol=1e-5)
        mask, ours = read_by_itk(tmp_path / name) > 300, sitk.ReadImage(str(target))
        laid = sitk.Resample(
            mask, ours, sitk.Transform(), sitk.sitkNearestNeighbor
        )  # a mask, onto the volume
        assert sitk.GetArrayFromImage(mask).sum() > 20
        np.testing.assert_array_equal(sitk.GetArrayFromImage(laid), sitk.GetArrayFromImage(ours > 300))
        grid = open_grid(target)
        assert (grid.space.name, grid.space.unit) == (space, unit)
        assert sorted(grid.spacing) == sorted(source.spacing)  # to the last bit: what is rendered is the same
        is_mirrored = np.linalg.det(grid.space.axes) < 0
        assert is_mirrored == (space == "3D-left-handed")
    again = prepare(open_source(target), tmp_path / "again.nrrd")  # is upright already
    assert (again.spacing, again.dims, again.space.name) == (grid.spacing, grid.dims, space)
    assert again.space.axes == pytest.approx(np.array(grid.space.axes))
    np.testing.assert_array_equal(open_grid(tmp_path / "again.nrrd").values, grid.values)
    np.testing.assert_allclose(center_by_itk(tmp_path / "again.nrrd"), expected, atol=1e-5)
    crop = [edge for size in source.dims for edge in (1, size - 1)]
    prepare(source, target, up="+z", crop=tuple(crop), reduce=2)
    np.testing.assert_allclose(center_by_itk(target), expected, atol=0.1)  # half a sample is 0.37 at least


def test_channels_have_the_space_of_the_first(tmp_path):
    by_nibabel(tmp_path / "v.nii", ORIENTED["oblique"])
    source = open_source(tmp_path / "v.nii")
    prepare_channels([source, source], tmp_path / "volume.nrrd", up="+z")
    header = nrrd.read_header(str(tmp_path / "volume.nrrd"))
    assert header["space"] == "right-anterior-superior"
    assert header["space units"] == ["mm"] * 3
    prepare(source, tmp_path / "one.nrrd", up="+z")
    one = nrrd.read_header(str(tmp_path / "one.nrrd"))
    np.testing.assert_array_equal(header["space directions"][:3], one["space directions"])
    assert open_grid(tmp_path / "volume.nrrd").space == open_grid(tmp_path / "one.nrrd").space
