"""Functions within the mask of a label, and channels of several types: casts, light, frames and surfaces."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from tests.refusals import refused
from tests.volume.functions import GREY, functions
from tests.volume.march import inside, march
from tests.volume.scenes import lattice
from tests.volume.test_matter import brute_force, require_close
from texgs.core.camera import orbit
from texgs.core.errors import DeviceError
from texgs.core.light import HEADLIGHT, Light
from texgs.fitting.casting import ends_of_rays
from texgs.volume.caster import OUTPUTS, TYPES, Caster
from texgs.volume.framing import frame_of, shown_corners
from texgs.volume.grid import Grid
from texgs.volume.isosurface import surface_of
from texgs.volume.matter import Matter
from texgs.volume.motion import motion
from texgs.volume.render import Appearance
from texgs.volume.transfer import TransferFunction
from texgs.volume.view_files import renderer_for

CAMERA, SIDE = orbit(25, 15, 2.6, 34, 57, 43), Light("directional", 40, 30)
LOOK = Appearance(step=0.5, opacity_unit=0.03)
UNIT = 0.03  # of opacities in `brute_force`, world units
BALL = TransferFunction(
    ((400.0, 0.0), (600.0, 0.05), (1000.0, 0.2)), ((500, 0.1, 0.2, 0.9), (999, 0.4, 0.5, 0.9))
)
ACROSS = TransferFunction(((-0.4, 0.0), (0.1, 0.04), (0.6, 0.1)), ((-0.4, 0.9, 0.6, 0.1),), channel=1)
LABEL = TransferFunction(((127.5, 0.3), (255.0, 0.3)), ((127.5, 0.1, 0.8, 0.2),), channel=2)
SETS = {
    "image in a label": [replace(BALL, within=2)],
    "part of an image in a label": [BALL, replace(ACROSS, within=2)],
    "image and a label": [BALL, LABEL],
    "all types": [replace(BALL, within=3), ACROSS, LABEL],
}


@pytest.fixture(scope="module")
def grid():
    """A ball of int16, what grows along x in single precision, and masks of a wavy floor and of a slab."""
    x, y, z = lattice(25, 21, 23)
    ball, across = 1000 * (1 - np.sqrt(x * x + y * y + z * z)), x + 0.1 * z
    masks = [
        np.clip(127.5 + 400 * field, 0, 255) for field in (0.3 * np.sin(4 * x) - y, 0.21 - np.abs(z - 0.1))
    ]
    others = across.astype(np.float32), *(mask.astype(np.uint8) for mask in masks)
    return Grid(ball.astype(np.int16), (1.0, 1.1, 0.9), others=others)


def cast(grid, tfs, device="cpu", **options):
    seen = Caster(grid, LOOK, device).cast(tfs, CAMERA, SIDE, OUTPUTS, **options)
    return {name: getattr(seen, name).cpu().numpy() for name in ("rgba", *OUTPUTS)}


def require_equal(one, other):
    for name, plane in one.items():
        assert_array_equal(plane, other[name])


@pytest.mark.parametrize("tfs", SETS.values(), ids=SETS)
@pytest.mark.parametrize("by_cell", [True, False])
def test_rays_agree_with_the_definition(grid, tfs, by_cell, device):
    expected, seen = march(grid, tfs, CAMERA, LOOK, SIDE), cast(grid, tfs, device, by_cell=by_cell)
    assert (expected.alpha > 0.1).any()
    assert_allclose(seen["rgba"][..., :3], expected.color, atol=3e-3)
    assert_allclose(seen["rgba"][..., 3], expected.alpha, atol=3e-3)
    assert np.abs(seen["depth"] - expected.depth.numpy()).mean() < 2e-3
    assert np.abs(seen["normal"] - expected.normal.numpy()).mean() < 3e-3


@pytest.mark.parametrize("dtype", TYPES)
def test_a_channel_beside_one_of_another_type_is_as_beside_its_own(dtype, device):
    """Whole numbers, of which all types know the same: bit by bit."""
    x, y, z = lattice(13, 9, 11)
    fields = [np.round(60 + 40 * x + 20 * y), np.round(50 + 60 * z - 20 * y).clip(0, 120)]
    tfs = [
        TransferFunction(((low, 0), (low + 30, 0.3), (120, 0.9)), ((60, 0.8, 0.4, 0.2),), channel)
        for channel, low in enumerate((40, 60))
    ]
    alike, mixed = (
        Grid(fields[0].astype(first), others=(fields[1].astype(np.float32),)) for first in ("float32", dtype)
    )
    require_equal(cast(mixed, tfs, device), cast(alike, tfs, device))
    matters = [Matter(Caster(each, LOOK, device), tfs, UNIT).extinction for each in (mixed, alike)]
    assert float(matters[0].max()) > 0
    assert torch.equal(*matters)


def test_a_mask_that_is_everywhere_changes_no_bit_and_one_that_is_nowhere_shows_nothing(grid, device):
    tf, (z, y, x) = replace(BALL, within=1), grid.values.shape
    full, empty = (replace(grid, others=(np.full((z, y, x), level, np.uint8),)) for level in (255, 127))
    require_equal(cast(full, tf, device), cast(grid, BALL, device))
    assert not cast(empty, tf, device)["rgba"].any()
    refused(lambda: frame_of(empty, [tf]), "expected some of the volume to be visible, got nothing")


@given(tf=functions(), seed=st.integers(0, 99), dims=st.tuples(*[st.integers(2, 10)] * 3))
def test_visible_cells_are_those_of_the_function_and_of_the_mask(tf, seed, dims):
    rng = np.random.default_rng(seed)
    mask = rng.choice(np.array([0, 100, 127, 128, 255], np.uint8), dims, p=[0.6, 0.1, 0.2, 0.05, 0.05])
    caster = Caster(Grid(rng.integers(-9, 10, dims).astype(np.float32), others=(mask,)), Appearance())
    of_mask = TransferFunction(((127.5, 1), (255, 1)), GREY, channel=1)
    each = [caster._shown(shown, by_cell=True) for shown in (replace(tf, within=1), tf, of_mask)]
    both, *alone = (words for *_, words in each)
    assert torch.equal(both, alone[0] & alone[1])
    near, *far = (distance[: len(both)] for *_, distance, _ in each)
    assert (near >= torch.maximum(*far)).all()
    assert not both[near > 0].any()


@pytest.mark.parametrize("tfs", SETS.values(), ids=SETS)
def test_light_passes_what_is_outside_of_a_mask(grid, tfs, device):
    matter = Matter(Caster(grid, LOOK, device), tfs, UNIT, longest=24)
    found = matter.extinction[1:-1, 1:-1, 1:-1]
    require_close(matter, brute_force(grid, tfs, found.shape[::-1]))


def test_frames_and_seeds_are_of_what_is_in_the_mask(grid):
    tf = replace(BALL, within=3)  # a slab around z = 0.1, 0.42 of the half thick on both sides
    within, around = (shown_corners(grid, [each]) / grid.aabb[1] for each in (tf, BALL))
    cell = 2 / (np.array(grid.dims) - 1)
    assert np.abs(within[:, 2] - 0.1).max() < 0.21 + cell[2]
    assert np.abs(around[:, 2]).max() > 0.4
    cameras = [orbit(azimuth, 20, 2.6, 34, 64, 64) for azimuth in (0, 120, 240)]
    ends = ends_of_rays(
        Caster(grid, LOOK), LOOK, replace(tf, opacity=((400, 0.9), (1000, 0.9))), cameras, 500, 0
    )
    assert len(ends.places) > 100
    nearest = LOOK.step * 2 / max(grid.dims)  # the step behind an end may begin outside
    assert (ends.places[:, 2] / grid.aabb[1][2] - 0.1).abs().max() < 0.21 + nearest + cell[2] / 2


def test_a_surface_ends_where_the_mask_does(grid):
    tf = replace(BALL, within=3)
    points = torch.from_numpy(surface_of(grid, tf, 0.05).vertices / grid.aabb[1]).double()
    whole = torch.from_numpy(surface_of(grid, BALL, 0.05).vertices / grid.aabb[1]).double()
    assert len(points) > 100
    assert (points[:, 2] - 0.1).abs().max() < 0.22
    kept = inside(grid, tf, whole)
    assert 0 < kept.sum() < len(whole)
    far = torch.cdist(whole[(whole[:, 2] - 0.1).abs() < 0.12], points).amin(dim=1)
    assert far.max() < 1e-5  # away from the mask's faces it is the same surface


def test_what_moves_outside_of_a_mask_moves_nothing_inside():
    x, y, z = lattice(24, 24, 24)
    mask = np.where(x < 0, 255, 0).astype(np.uint8)
    still = np.exp(-8 * ((x + 0.5) ** 2 + y**2 + z**2))
    before, after = (
        Grid(
            (still + np.exp(-20 * ((x - 0.5) ** 2 + (y - shift) ** 2 + z**2))).astype(np.float32),
            others=(mask,),
        )
        for shift in (0, 0.4)
    )
    tf = TransferFunction(((0.2, 0), (1, 0.9)), GREY, within=1)
    assert float(motion(before, after, tf).displacements.abs().max()) < 1e-3
    assert float(motion(before, after, replace(tf, within=None)).displacements.abs().max()) > 0.05


def test_what_no_mask_can_be_is_refused(grid):
    caster = Caster(grid, LOOK)
    for number, message in ((1, "within: expected a mask of uint8, got channel 1 of float32"), (4, "0 to 3")):
        refused(lambda: caster.cast(replace(BALL, within=number), CAMERA, HEADLIGHT), message)  # noqa: B023
    refused(
        lambda: renderer_for("vtk", grid, LOOK, replace(BALL, within=2)),
        "views.renderer: expected cpu or gpu for a function within a label, got vtk",
        DeviceError,
    )
