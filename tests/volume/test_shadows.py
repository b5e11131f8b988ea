"""Pictures of volumes with shadows and occlusion, against rays to the light from every sample."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from tests.volume.light_rays import LightRays
from tests.volume.march import march
from tests.volume.scenes import SHELLS, ball, lattice, psnr
from texgs.core.camera import orbit
from texgs.core.cuts import NO_CUTS, Cuts, Plane
from texgs.core.light import HEADLIGHT, Light
from texgs.raster.api import cut_range
from texgs.volume.caster import OUTPUTS, Caster
from texgs.volume.grid import Grid
from texgs.volume.matter import SKY_DIRECTIONS, Matter, even_directions
from texgs.volume.render import Appearance
from texgs.volume.transfer import TransferFunction

CAMERA = orbit(-55, 30, 2.4, 24, 48, 48)
LAMP = Light("directional", -120, 45, shadows=1.0)
BROWN = ((0, 0.8, 0.6, 0.4),)


def before_a_wall(middle=0.3):
    """A ball of radius 0.45 around z = middle before the wall z = -0.6; values fall from 0 at both."""
    x, y, z = lattice(40, 40, 40)
    return Grid(np.maximum(0.45 - np.sqrt(x * x + y * y + (z - middle) ** 2), -0.6 - z))


def ball_and_slope():
    x, y, z = lattice(32, 32, 32)
    return Grid(1 - np.sqrt(x * x + y * y + z * z), others=(np.ascontiguousarray(x + 0.1 * z),))


SOLID = TransferFunction(((0.0, 0.0), (0.05, 0.9), (3, 0.9)), BROWN)  # over a voxel
SUDDEN = TransferFunction(((0.0, 1.0), (3, 1.0)), BROWN)
SHELL = TransferFunction(
    ((0.3, 0), (0.4, 0.04), (0.5, 0), (0.55, 0), (0.65, 0.3), (1, 0.3)),
    ((0.3, 0.2, 0.5, 0.9), (0.6, 0.9, 0.5, 0.2)),
)
BOTH = [
    TransferFunction(((0.4, 0), (0.6, 0.05), (1, 0.2)), ((0.5, 0.1, 0.2, 0.9),)),
    TransferFunction(((0.3, 0), (0.5, 0.04), (0.7, 0.1)), ((0, 0.9, 0.6, 0.1),), channel=1),
]
CUT = Cuts([Plane([0.3, 0.2, 1.0], 0.1)])
THIN = Appearance(step=0.5, opacity_unit=0.02)
SCENES = {
    "an opaque ball before a wall": (before_a_wall(), [SOLID], Appearance(), NO_CUTS),
    "an opaque ball in a wall": (before_a_wall(-0.4), [SOLID], Appearance(), NO_CUTS),
    "a translucent shell": (ball(40), [SHELL], THIN, NO_CUTS),
    "two channels": (ball_and_slope(), BOTH, replace(THIN, opacity_unit=0.03), NO_CUTS),
    "a cut shell": (ball(40), [SHELL], THIN, CUT),
    "a ball that begins suddenly": (before_a_wall(), [SUDDEN], Appearance(), NO_CUTS),
}


def pictures(grid, tfs, look, cuts, light, camera, device, longest=128):
    """RGBA [H, W, 4]: of the grid's light, of rays to the light, and of light that nothing hides."""
    planes, cut = cuts.half_spaces, None
    if planes:
        normals, offsets = [each.normal for each in planes], [each.offset for each in planes]
        cut = cut_range(torch.tensor(normals), torch.tensor(offsets), camera)
    caster, faces = Caster(grid, look, device), {}
    if cut:
        on_device = cut._replace(**{name: x.to(device) for name, x in cut._asdict().items()})
        faces = {"depth_range": on_device.depth_range, "faces": on_device}
    cells = Matter(caster, tfs, look.opacity_unit, cuts, longest).lit(
        light.direction(camera) if light.shadows else None, light.reach if light.occlusion else None
    )
    seen = caster.cast(tfs, camera, light, cells=cells, **faces).rgba.cpu()
    rays = LightRays(grid, tfs, look.opacity_unit, cuts)
    exposure = rays.exposure(light, even_directions(SKY_DIRECTIONS), cells.outset)
    marched = [march(grid, tfs, camera, look, light, each, cut) for each in (exposure, None)]
    return seen, *(torch.cat([each.color, each.alpha[..., None]], dim=-1) for each in marched)


def decibels(one, other):
    """PSNR of a picture, and of its pixels where anything is seen."""
    is_seen = other[..., 3] > 0.02
    return psnr(one.numpy(), other.numpy()), psnr(one[is_seen].numpy(), other[is_seen].numpy())


@pytest.mark.large
@pytest.mark.parametrize(("scene", "whole", "of_object"), [
    ("an opaque ball before a wall", 42, 40),
    ("a translucent shell", 65, 60),
    ("two channels", 65, 65),
    ("a cut shell", 60, 55),
    ("a ball that begins suddenly", 36, 34),  # as its shadow does: what the grid shows is a cell wide
])  # fmt: skip
def test_shadows_are_those_of_rays_to_the_light(scene, whole, of_object, device):
    seen, expected, unhidden = pictures(*SCENES[scene], LAMP, CAMERA, device)
    assert decibels(unhidden, expected)[0] < whole - 10  # shadows are seen
    found = decibels(seen, expected)
    assert found[0] > whole
    assert found[1] > of_object


@pytest.mark.large
@pytest.mark.parametrize("longest", [64, 32])
def test_fewer_cells_show_softer_shadows(longest, device):
    solid, shell = (
        decibels(*pictures(*SCENES[name], LAMP, CAMERA, device, longest)[:2])
        for name in ("an opaque ball before a wall", "a translucent shell")
    )
    assert min(solid) > {64: 38, 32: 32}[longest]
    assert min(shell) > {64: 55, 32: 46}[longest]


@pytest.mark.large
@pytest.mark.parametrize("light", [
    Light("headlight", occlusion=1.0, reach=0.2),
    Light("directional", -120, 45, shadows=0.7, occlusion=0.5, reach=0.15),
])  # fmt: skip
@pytest.mark.parametrize(("scene", "least"), [
    ("an opaque ball in a wall", 36),  # in the grid opaque matter stands out by half a cell
    ("a cut shell", 39),
])  # fmt: skip
def test_occlusion_is_that_of_rays_to_all_directions(scene, least, light, device):
    grid, tfs, look, cuts = SCENES[scene]
    camera = orbit(-55, 30, 2.4, 24, 20, 20)
    seen, expected, unhidden = pictures(grid, tfs, replace(look, ambient=0.7), cuts, light, camera, device)
    found = min(decibels(seen, expected))
    assert found > least
    assert found > decibels(unhidden, expected)[1] + 8


@pytest.mark.parametrize("light", [HEADLIGHT, Light("directional", 30, 40)])
def test_without_shadows_cells_change_no_bit(light, device):
    caster = Caster(ball(24), Appearance(), device)
    cells = Matter(caster, [SHELLS], 0.005, longest=16).lit(torch.tensor([0.0, 1.0, 0.0]), 0.2)
    expected, seen = (caster.cast(SHELLS, CAMERA, light, OUTPUTS, cells=each) for each in (None, cells))
    for name in ("rgba", *OUTPUTS):
        assert torch.equal(getattr(seen, name), getattr(expected, name))


def test_a_headlight_casts_no_shadows(device):
    caster = Caster(ball(24), Appearance(), device)
    cells = Matter(caster, [SHELLS], 0.005, longest=16).lit(torch.tensor([0.0, 1.0, 0.0]), None)
    expected = caster.cast(SHELLS, CAMERA, HEADLIGHT).rgba
    assert torch.equal(
        caster.cast(SHELLS, CAMERA, replace(HEADLIGHT, shadows=1.0), cells=cells).rgba, expected
    )


def test_shadows_change_light_only_and_by_their_strength(device):
    """Colours are linear in it where none is cut off at 1; what is seen, and where, stays as it is."""
    caster = Caster(before_a_wall(), Appearance(specular=0), device)
    cells = Matter(caster, [SOLID], 0.005).lit(LAMP.direction(CAMERA), 0.2)
    none, half, full = (
        caster.cast(SOLID, CAMERA, replace(LAMP, shadows=s, occlusion=s), OUTPUTS, cells=cells)
        for s in (0.0, 0.5, 1.0)
    )
    assert float((none.rgba - full.rgba).max()) > 0.2
    torch.testing.assert_close(half.rgba, (none.rgba + full.rgba) / 2, rtol=0, atol=1e-5)
    for name in OUTPUTS:
        assert torch.equal(getattr(full, name), getattr(none, name))


def test_rays_to_the_light_agree_with_the_way_through_even_matter():
    """The definition itself: of a box of even matter, and half of the sky on a half-space."""
    x, _, z = lattice(9, 9, 9)
    even = LightRays(Grid(x), [TransferFunction(((-2, 0.2), (2, 0.2)), BROWN)], 0.1)
    points = torch.tensor([[0.0, 0.0, 0.0], [0.2, -0.3, 0.4], [0.1, 0.0, 0.7]])
    found = even.transmittance(points, torch.tensor([0.0, 0.0, 2.0]))
    torch.testing.assert_close(found, 0.8 ** torch.tensor([5.0, 1.0, 0.0]).double())
    below = TransferFunction(((-2, 1.0), (0, 1.0)), BROWN)
    floor = LightRays(Grid(np.ascontiguousarray(z)), [below], 0.1)
    places = torch.tensor([[0.0, 0.0, 0.001], [0.0, 0.0, -0.1]])
    found = floor.openness(places, even_directions(64), 0.05)
    torch.testing.assert_close(found, torch.tensor([1.0, 0.0]).double())
    cut = replace(floor, cuts=Cuts([Plane([0.0, 0.0, -1.0], 0.2)]))
    through = cut.transmittance(torch.tensor([[0.0, 0.0, -0.3]]), torch.tensor([0.0, 0.0, -1.0]))
    assert float(through) == 1
