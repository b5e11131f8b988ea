"""Masks of labels: on the right side at every sample, smooth, and on the lattice of the image beside them."""

import numpy as np
import pytest
import SimpleITK
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_array_equal

from tests.refusals import refused
from texgs.volume.grid import Grid
from texgs.volume.label_choice import choose, labels_in
from texgs.volume.label_masks import HALF, INSIDE, KERNEL, MARGIN, MaskSource, label_counts, on_lattice_of
from texgs.volume.label_names import Label
from texgs.volume.nrrd_file import masks_in, open_grid
from texgs.volume.prepare import prepare_channels
from texgs.volume.settings import VolumeKeys, open_masks
from texgs.volume.slabs import ArraySource
from texgs.volume.sources import open_source

SHAPES = st.tuples(*[st.integers(2, 9)] * 3)
VOLUMES = SHAPES.flatmap(lambda shape: arrays(np.int16, shape, elements=st.sampled_from([-2, 0, 1, 3, 900])))


def source(values, name="seg.nrrd"):
    return ArraySource(Grid(np.asarray(values)), name)


def mask_of(values, number):
    mask = MaskSource(source(values), number)
    return mask.slices(0, mask.dims[2])


@given(VOLUMES, st.sampled_from([-2, 1, 3, 900, 7]))
def test_each_sample_is_on_the_side_of_its_own_label(values, number):
    assert_array_equal(mask_of(values, number) > HALF, values == number)


@given(VOLUMES, st.data())
def test_slabs_of_any_size_are_the_same_bytes(values, data):
    mask, whole = MaskSource(source(values), 3), mask_of(values, 3)
    start = data.draw(st.integers(0, len(values) - 1))
    stop = data.draw(st.integers(start + 1, len(values)))
    assert_array_equal(mask.slices(start, stop), whole[start:stop])


@given(VOLUMES)
def test_samples_are_those_of_the_kernel_in_float64_but_for_their_side(values):
    soft = np.pad((values == 1).astype(np.float64), len(KERNEL) // 2, mode="edge")
    for axis in range(3):
        soft = np.apply_along_axis(np.convolve, axis, soft, [1 / 16, 4 / 16, 6 / 16, 4 / 16, 1 / 16], "valid")
    least, most = HALF + MARGIN, HALF - MARGIN
    expected = np.where(values == 1, np.maximum(INSIDE * soft, least), np.minimum(INSIDE * soft, most))
    assert np.abs(mask_of(values, 1) - expected).max() <= 0.51


@pytest.mark.parametrize("axis", range(3))
def test_a_plane_is_half_way_between_the_samples_beside_it(axis):
    values = np.moveaxis(np.repeat([0, 5], 6)[:, None, None] * np.ones((1, 4, 4), int), 0, axis)
    line = np.moveaxis(mask_of(values, 5), axis, 0)[:, 1, 1].astype(float)
    assert line[5] + line[6] == INSIDE, "the straight line between them is at one half in the middle"
    assert (line[0], line[-1]) == (0, INSIDE)


def test_labels_are_counted_in_slabs_and_within_bounds(monkeypatch):
    values = np.random.default_rng(0).integers(0, 5, (9, 8, 7))
    numbers, counts = np.unique(values[values > 0], return_counts=True)
    monkeypatch.setattr("texgs.volume.slabs.SLAB_BYTES", 2 * values[0].nbytes)
    assert label_counts(source(values)) == dict(zip(numbers.tolist(), counts.tolist(), strict=True))
    part = values[4:9, 1:3, 2:6]
    assert label_counts(source(values), [(2, 6), (1, 3), (4, 9)]) == {
        k: (part == k).sum() for k in range(1, 5)
    }


@pytest.mark.parametrize("bad", [np.nan, 0.5, np.inf])
def test_samples_that_are_no_whole_numbers_are_no_labels(bad):
    values = np.zeros((3, 3, 3), np.float32)
    values[1, 1, 1] = bad
    refused(
        lambda: label_counts(source(values)), f"seg.nrrd: expected labels, which are .*, got {bad:g}; is it"
    )


def test_the_largest_are_shown_or_those_that_are_named():
    values = np.zeros((4, 4, 4), int)
    values[0], values[1, :2], values[2, 0], values[3, 0, 0] = 7, 3, 12, 1
    known = [Label(12, "liver", (1, 0, 0)), Label(99, "absent")]
    found = labels_in(lambda layer: source(values), known)
    assert [(each.number, each.name, each.samples) for each in found] == [
        (7, "7", 16), (3, "3", 8), (12, "liver", 4), (1, "1", 1),
    ]  # fmt: skip
    assert [each.number for each in choose(found, None, 3)] == [3, 7, 12]
    assert [each.number for each in choose(found, None, 16, least=2)] == [3, 7, 12]
    assert [each.number for each in choose(found, ["liver", "7", "12"], 16)] == [12, 7]
    refused(
        lambda: choose(found, ["absent"], 16), "labels: no such label 'absent'; expected some of 7, 3, liver"
    )
    refused(lambda: choose(found, ["3", "7"], 1), "labels: expected 1 to 1 labels, got 2; leave some out")
    refused(
        lambda: labels_in(lambda layer: source(0 * values), known), "seg.nrrd: expected labels, got 0 every"
    )


def test_a_mask_that_a_crop_or_reduction_leaves_empty_is_told(tmp_path):
    values = np.zeros((8, 8, 8), np.uint8)
    values[:4], values[6, 6, 6] = 2, 7
    masks = [MaskSource(source(values), 2), MaskSource(source(values), 7)]
    target = tmp_path / "volume.nrrd"
    told = "label 7 of seg.nrrd: expected some samples, got none in the crop, or too few for reduce"
    refused(lambda: prepare_channels(masks, target, crop=(0, 8, 0, 8, 0, 5)), told)
    refused(lambda: prepare_channels(masks, target, reduce=4), told)
    assert not target.exists()


def test_masks_behind_an_image_keep_their_type_and_can_be_taken_from_the_file(tmp_path):
    image = np.random.default_rng(0).normal(size=(5, 6, 7)).astype(np.float32)
    labels = np.random.default_rng(1).integers(0, 3, image.shape)
    masks = [MaskSource(source(labels), 1, "liver"), MaskSource(source(labels), 2)]
    file = tmp_path / "volume.nrrd"
    prepare_channels([source(image), *masks], file)
    grid = open_grid(file)
    assert_array_equal(grid.values, image)
    assert_array_equal(np.stack(grid.others), [mask_of(labels, 1), mask_of(labels, 2)])
    assert_array_equal(open_source(file).slices(0, 5), image)
    assert_array_equal(SimpleITK.GetArrayFromImage(SimpleITK.ReadImage(file)), image)
    assert list(masks_in(file)) == ["liver", "2"]
    again = open_masks(VolumeKeys(labels=str(file)), file, ["2", "liver"], open_source(file))
    assert_array_equal(again[1].slices(0, 5), grid.others[0])
    refused(
        lambda: open_masks(VolumeKeys(), file, ["5"]), "volume.nrrd: no such label '5'; expected .*liver, 2"
    )
    prepare_channels([open_source(file), *again[::-1]], tmp_path / "again.nrrd")
    assert (tmp_path / "again.nrrd").read_bytes() == file.read_bytes()
    assert not masks_in(tmp_path / "seg.nii.gz")


def turned(seed):
    """An image and its labels as SimpleITK has them: axes permuted, mirrored, spaced and moved."""
    random = np.random.default_rng(seed)
    image = SimpleITK.GetImageFromArray(random.integers(0, 4, (5, 6, 7)).astype(np.uint8))
    image.SetSpacing((1.5, 2, 0.5))
    image.SetOrigin(tuple(random.normal(0, 30, 3)))
    image.SetDirection(np.eye(3)[random.permutation(3)].ravel() * random.choice([-1, 1]))
    return image


@pytest.mark.parametrize("seed", range(4))
def test_labels_in_another_space_lie_where_those_of_simpleitk_do(tmp_path, seed):
    """NRRD is in LPS and NIfTI in RAS: each sample of one is that of the other at the same place."""
    image = turned(seed)
    SimpleITK.WriteImage(image, tmp_path / "seg.nrrd")
    SimpleITK.WriteImage(SimpleITK.Cast(image, SimpleITK.sitkFloat32), tmp_path / "ct.nii.gz")
    labels, ct = open_source(tmp_path / "seg.nrrd"), open_source(tmp_path / "ct.nii.gz")
    for one, other in ((labels, ct), (ct, labels)):
        moved = on_lattice_of(one, other)
        assert moved.space.name == other.space.name
        assert_array_equal(moved.slices(0, moved.dims[2]), other.slices(0, other.dims[2]))
        assert_array_equal(moved.slices(1, 3), other.slices(1, 3))


@pytest.mark.parametrize("change", ["spacing", "origin", "dims"])
def test_labels_beside_the_image_are_refused(tmp_path, change):
    image, other = turned(0), turned(0)
    SimpleITK.WriteImage(image, tmp_path / "ct.nrrd")
    if change == "dims":
        other = other[:-1]
    else:
        getattr(other, f"Set{change.capitalize()}")((1.5, 2, 0.6) if change == "spacing" else (0, 0, 0.3))
    SimpleITK.WriteImage(other, tmp_path / "seg.nrrd")
    labels, ct = open_source(tmp_path / "seg.nrrd"), open_source(tmp_path / "ct.nrrd")
    refused(
        lambda: on_lattice_of(labels, ct), "seg.nrrd: expected labels on the lattice of ct.nrrd, .*resample"
    )
