"""Slices against files read by SimpleITK, nibabel and pynrrd on their own; places there and back."""

import nibabel
import nrrd
import numpy as np
import pytest
import SimpleITK as sitk
from hypothesis import given
from hypothesis import strategies as st

from tests.real_data import real_data
from tests.refusals import refused
from tests.volume.scenes import ball
from tests.volume.test_space import ORIENTED, WRITERS, blob, read_by_itk
from texgs.volume.grid import UPRIGHT, Grid
from texgs.volume.nrrd_file import open_grid
from texgs.volume.prepare import prepare
from texgs.volume.slices import place_at, planes_of, point_of, slice_of, windowed
from texgs.volume.sources import open_source
from texgs.volume.space import LPS, RAS, Space

PATIENT = {"sagittal": "APIS", "coronal": "RLIS", "axial": "RLPA"}  # left, right, bottom, top
FILES = ("v.nii", "ras.nrrd", "v.nrrd", "v.mha")


def prepared(path, up, folder, **keys):
    prepare(open_source(path, **keys), folder / "volume.nrrd", up=up)
    return open_grid(folder / "volume.nrrd")


def pictures(grid):
    """All slices by the names of their planes."""
    return {
        plane.name: np.stack([slice_of(grid, plane, number) for number in range(plane.count)])
        for plane in planes_of(grid)
    }


def of_patient(values, space):
    """Slices of samples [S, P, L] that run to the head, the back and the left; RAS counts back."""
    back = slice(None, None, -1 if space == RAS else 1)
    upright = values[::-1]
    return {
        "sagittal": upright.transpose(2, 0, 1)[back],
        "coronal": upright.transpose(1, 0, 2)[back],
        "axial": values,
    }


def assert_same(seen, expected):
    assert list(seen) == list(expected)
    for name, values in expected.items():
        assert seen[name].dtype == values.dtype
        np.testing.assert_array_equal(seen[name], values, err_msg=name)


@pytest.mark.parametrize("up", UPRIGHT)
@pytest.mark.parametrize("oriented", ORIENTED)
@pytest.mark.parametrize("name", FILES)
def test_slices_of_a_patient_are_the_samples_of_the_file_from_left_front_and_feet(
    tmp_path, name, oriented, up
):
    WRITERS[name][0](tmp_path / name, ORIENTED[oriented])
    grid = prepared(tmp_path / name, up, tmp_path)
    turned = sitk.GetArrayFromImage(sitk.DICOMOrient(read_by_itk(tmp_path / name), "LPS"))
    assert_same(pictures(grid), of_patient(turned, grid.space.name))
    assert {plane.name: "".join(plane.ends) for plane in planes_of(grid)} == PATIENT


@pytest.mark.parametrize("up", ["+y", "+z", "-x"])
def test_samples_of_nifti_are_those_that_nibabel_turns(tmp_path, up):
    path = real_data("volumes/mni152.nii.gz")
    grid = prepared(path, up, tmp_path)
    samples = nibabel.as_closest_canonical(nibabel.load(path)).dataobj
    values = np.asarray(samples).T[:, ::-1, ::-1].astype(grid.values.dtype)
    assert_same(pictures(grid), of_patient(values, grid.space.name))


@pytest.mark.parametrize("up", UPRIGHT)
@pytest.mark.parametrize("oriented", ORIENTED)
def test_in_an_unknown_space_x_is_to_the_right_and_the_last_axis_up(tmp_path, oriented, up):
    WRITERS["left.nrrd"][0](tmp_path / "v.nrrd", ORIENTED[oriented])
    grid = prepared(tmp_path / "v.nrrd", up, tmp_path)
    values, header = nrrd.read(str(tmp_path / "v.nrrd"))
    affine = np.eye(4)
    affine[:3, :3] = header["space directions"].T
    turn = nibabel.orientations.io_orientation(affine)
    assert_same(pictures(grid), of_axes(nibabel.orientations.apply_orientation(values, turn)))
    assert {plane.ends for plane in planes_of(grid)} == {("",) * 4}


def of_axes(values):
    """Slices of samples [X, Y, Z] along the axes of their space."""
    x, y, z = values.transpose(0, 2, 1), values.transpose(1, 2, 0), values.transpose(2, 1, 0)
    return {"x": x[:, ::-1], "y": y[:, ::-1], "z": z[:, ::-1]}


@pytest.mark.parametrize("up", UPRIGHT)
def test_raw_samples_have_the_axes_that_they_are_stored_by(tmp_path, up):
    blob().tofile(tmp_path / "v.raw")
    grid = prepared(tmp_path / "v.raw", up, tmp_path, dims=blob().shape[::-1], dtype="int16")
    assert_same(pictures(grid), of_axes(blob().T))


@pytest.mark.parametrize("up", UPRIGHT)
@pytest.mark.parametrize("name", ["v.nii", "v.nrrd"])
def test_a_place_has_the_position_and_value_of_the_file(tmp_path, name, up):
    """By SimpleITK, whose places are in LPS."""
    WRITERS[name][0](tmp_path / name, ORIENTED["oblique"])
    grid, image = prepared(tmp_path / name, up, tmp_path), read_by_itk(tmp_path / name)
    signs = (-1, -1, 1) if grid.space.name == RAS else (1, 1, 1)
    for index in ((0, 0, 0), (3, 7, 11), (12, 9, 14)):
        place = place_at(grid, point_of(grid, index))
        there = image.TransformPhysicalPointToContinuousIndex(np.multiply(place.position, signs).tolist())
        assert there == pytest.approx(np.rint(there), abs=1e-4)
        assert place.value == image.GetPixel(*map(round, there))
        for plane, number in zip(planes_of(grid), place.index, strict=True):
            assert place.value in slice_of(grid, plane, number)


@st.composite
def grids(draw):
    """A lattice of any axes, whose samples are all different."""
    dims = [draw(st.integers(2, 5)) for _ in range(3)]
    turn = np.linalg.qr(np.random.default_rng(draw(st.integers(0, 99))).normal(size=(3, 3)))[0]
    spacing = tuple(draw(st.floats(0.1, 10)) for _ in range(3))
    values = np.arange(np.prod(dims), dtype=np.float32).reshape(dims)
    return Grid(
        values, spacing, (1.0, -2.0, 3.0), space=Space.along(turn, draw(st.sampled_from([LPS, RAS, ""])))
    )


@given(grids(), st.data())
def test_the_place_at_the_point_of_a_sample_is_that_sample(grid, data):
    counts = [plane.count for plane in planes_of(grid)]
    index = tuple(data.draw(st.integers(0, count - 1)) for count in counts)
    near = [
        x + 0.49 * grid.scale * data.draw(st.floats(-1, 1)) * step
        for x, step in zip(point_of(grid, index), grid.spacing, strict=True)
    ]
    place = place_at(grid, near)
    assert place.index == index
    slices = [slice_of(grid, *each) for each in zip(planes_of(grid), index, strict=True)]
    assert set.intersection(*(set(each.ravel().tolist()) for each in slices)) == {place.value}
    back = grid.world.points(np.array([point_of(grid, index)]))[0]
    assert place.position == pytest.approx(back, abs=1e-9 * max(grid.sides))


def test_there_is_nothing_beyond_the_outermost_samples():
    grid = ball(9)
    corner = np.array(grid.aabb[1]) * 9 / 8  # half a sample beyond the last one
    assert place_at(grid, corner * 0.999).index == (8, 8, 8)
    assert place_at(grid, corner * (1.001, 1, 1)) is None
    assert place_at(grid, [0, np.nan, 0]) is None
    plane = planes_of(grid)[0]
    for number in (-1, 9):
        refused(lambda at=number: slice_of(grid, plane, at), f"slice: expected x from 0 to 8, got {number}")


def test_a_window_is_black_below_and_white_above():
    values = np.array([[-np.inf, -5, 0, 50, 100, 300, np.nan, np.inf]])
    assert windowed(values, 0, 100).tolist() == [[0, 0, 0, 128, 255, 255, 0, 255]]
    assert windowed(np.array([[1, 2, 3]], np.uint8), 2, 2).tolist() == [[0, 0, 255]]
