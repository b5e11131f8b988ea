"""Volumes that planes cut open: rays within depth ranges, and what faces look like."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from tests.volume.march import shade
from tests.volume.scenes import SHELLS, ball, constant, lattice, over_white, psnr
from tests.volume.vtk_caster import VtkCaster
from texgs.core.camera import orbit
from texgs.core.errors import ArgumentError, ShapeError
from texgs.core.light import HEADLIGHT, Light
from texgs.raster.api import cut_range
from texgs.volume.caster import OUTPUTS, Caster
from texgs.volume.grid import Grid
from texgs.volume.render import Appearance, directions
from texgs.volume.transfer import TransferFunction

CAMERA, SIDE = orbit(-60, 20, 2.5, 30, 60, 50), Light("directional", 30, 40)
COLOR = (0.8, 0.4, 0.2)


def ranges(near, far, camera=CAMERA):
    """One range [2, H, W] for all pixels."""
    return torch.tensor([near, far])[:, None, None].expand(2, camera.height, camera.width)


def planes(normals, offsets, camera, device):
    """The cut of planes, given as lists."""
    return cut_range(
        torch.tensor(normals).float().to(device), torch.tensor(offsets).to(device), camera.to(device)
    )


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("light", [HEADLIGHT, SIDE])
def test_a_cut_is_the_array_cropped_at_a_plane_of_samples(axis, light, device):
    """Cropped, the volume has another centre, and gradients at its end that the face replaces."""
    x, y, z = lattice(33, 33, 33)
    grid, last = Grid(np.cos(3 * x + 2 * y) + np.sin(4 * z - y)), 20
    keep = [slice(None)] * 3
    keep[2 - axis] = slice(0, last + 1)
    cropped, place = Grid(grid.values[tuple(keep)].copy()), last / 32 - 0.5
    normal, centre = torch.eye(3)[axis], torch.eye(3)[axis] * (place - 0.5) / 2
    camera = orbit(*[(20, 25), (30, 65), (-70, 25)][axis], 2.5, 30, 50, 40)
    viewmat = camera.viewmat.clone()
    viewmat[:3, 3] += viewmat[:3, :3] @ centre
    moved = replace(camera, viewmat=viewmat)
    tf = TransferFunction(((-1, 0.0), (0, 0.3), (2, 0.8)), ((-1, *COLOR), (2, 0.1, 0.3, 0.9)))
    look = Appearance(step=0.0625, opacity_unit=0.04)
    images = []
    for values, view, offset in ((grid, camera, place), (cropped, moved, place - float(centre[axis]))):
        cut = planes([normal.tolist()], [offset], view, device)
        cast = Caster(values, look, device).cast(tf, view, light, depth_range=cut.depth_range, faces=cut)
        images.append(over_white(cast.rgba.cpu().numpy()))
        assert float((cut.face == 0).float().mean()) > 0.9  # the plane is before the camera
    assert psnr(*images) > 55


@pytest.mark.parametrize("count", [1, 3])
def test_vtk_cuts_alike(count):
    """Without light from anywhere, for VTK shades faces by gradients: all pixels, and those of faces."""
    grid, look = ball(40), Appearance(ambient=1, diffuse=0, specular=0, step=0.1, opacity_unit=0.05)
    ours, theirs = Caster(grid, look), VtkCaster(grid, look, threads=1)
    rng = torch.Generator().manual_seed(count)
    for _ in range(3):
        normals = torch.nn.functional.normalize(torch.randn(count, 3, generator=rng), dim=1)
        normals *= torch.where(normals @ CAMERA.position < 0, -1.0, 1.0)[:, None]  # faces are seen
        offsets = 0.15 * torch.rand(count, generator=rng)
        cut = cut_range(normals, offsets, CAMERA)
        theirs.cut(normals.tolist(), offsets.tolist())
        seen = over_white(ours.cast(SHELLS, CAMERA, HEADLIGHT, depth_range=cut.depth_range).rgba.numpy())
        expected = over_white(theirs.render(SHELLS, CAMERA, HEADLIGHT))
        uncut = over_white(ours.cast(SHELLS, CAMERA, HEADLIGHT).rgba.numpy())
        is_face = np.abs(seen - uncut).max(axis=-1) > 0.05
        assert is_face.sum() > 100
        assert psnr(seen, expected) > 38
        assert psnr(seen[is_face], expected[is_face]) > 32


@pytest.mark.parametrize(("step", "unit"), [(0.25, 0.2), (1.0, 0.2), (1.0, 0.05)])
def test_alpha_of_even_matter_follows_the_length_that_is_left(step, unit, device):
    x, _, _ = lattice(33, 33, 33)
    generator = torch.Generator().manual_seed(0)
    depth_range = 2.3 + 0.4 * torch.rand(2, 50, 60, generator=generator)  # all in the box, where the ray is
    look = Appearance(step=step, opacity_unit=unit)
    camera = orbit(-60, 20, 2.5, 6, 60, 50)
    cast = Caster(Grid(x), look, device).cast(constant(0.3), camera, HEADLIGHT, depth_range=depth_range)
    length = (depth_range[1] - depth_range[0]).clamp_min(0) * camera.rays().norm(dim=-1)
    np.testing.assert_allclose(cast.rgba[..., 3].cpu(), 1 - 0.7 ** (length / unit), atol=1e-4)


@pytest.mark.parametrize("step", [0.25, 1.5])
def test_parts_of_rays_join_wherever_they_are_split(step, device):
    caster = Caster(ball(40), Appearance(step=step, opacity_unit=0.3), device)
    split = 2.2 + 0.6 * torch.rand(50, 60, generator=torch.Generator().manual_seed(0))
    low, high = torch.zeros(50, 60), torch.full((50, 60), torch.inf)
    whole, front, back = (
        caster.cast(SHELLS, CAMERA, SIDE, depth_range=torch.stack(part)).rgba.cpu()
        for part in ((low, high), (low, split), (split, high))
    )
    torch.testing.assert_close(front + (1 - front[..., 3:]) * back, whole, rtol=0, atol=2e-6)
    assert float(front[..., 3].max()) > 0.1
    assert float(back[..., 3].max()) > 0.1


@pytest.mark.parametrize("radius", [2.5, 0.3])
def test_a_range_of_everything_changes_no_bit(radius, device):
    camera = orbit(-60, 20, radius, 30, 60, 50)
    caster = Caster(ball(40), Appearance(), device)
    expected = caster.cast(SHELLS, camera, SIDE, OUTPUTS)
    cut = planes([[0.0, 0.0, 1.0]], [9.0], camera, device)  # beyond the volume
    none = cut_range(torch.zeros(0, 3, device=device), torch.zeros(0, device=device), camera.to(device))
    for depth_range in (ranges(-torch.inf, torch.inf), cut.depth_range, none.depth_range):
        cast = caster.cast(SHELLS, camera, SIDE, OUTPUTS, depth_range=depth_range, faces=cut)
        for name in ("rgba", *OUTPUTS):
            assert torch.equal(getattr(cast, name), getattr(expected, name))


def test_nothing_is_seen_where_no_ray_is_left(device):
    cut = planes([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]], [-0.1, -0.1], CAMERA, device)  # z <= -0.1 and z >= 0.1
    caster = Caster(ball(20), Appearance(), device)
    assert not caster.cast(SHELLS, CAMERA, SIDE, depth_range=cut.depth_range, faces=cut).rgba.any()
    for empty in ((3.0, 2.0), (torch.inf, torch.inf), (-3.0, 0.0)):
        assert not caster.cast(SHELLS, CAMERA, SIDE, depth_range=ranges(*empty)).rgba.any()


CORNER = [[1.0, 0.2, 0.0], [0.0, 2.0, 0.1], [0.0, 0.0, 1.0]], [0.2, 0.5, 0.15]  # three faces towards VIEW
VIEW = orbit(-40, 35, 2.5, 20, 50, 40)


@pytest.mark.parametrize("light", [HEADLIGHT, SIDE])
@pytest.mark.parametrize("opacity", [1.0, 0.6])
def test_faces_have_the_intensity_of_their_planes_over_a_unit(opacity, light, device):
    """Behind a unit even matter is ambient: there is no gradient."""
    x, _, _ = lattice(17, 17, 17)
    look = Appearance(step=0.05, opacity_unit=0.02)
    caster, cut = Caster(Grid(0 * x), look, device), planes(*CORNER, VIEW, device)
    lit, unlit = (
        caster.cast(
            constant(opacity, COLOR),
            VIEW,
            light,
            ("normal",),
            depth_range=cut.depth_range,
            faces=cut,
            lit_faces=is_lit,
        )
        for is_lit in (True, False)
    )
    color, inner = torch.tensor([COLOR]).double(), look.ambient * torch.tensor(COLOR)
    to_viewer, to_light = (torch.from_numpy(v).double() for v in directions(VIEW, light))
    for i, normal in enumerate(cut.normals.cpu().double()):
        own = (cut.face.cpu() == i) & (lit.rgba[..., 3].cpu() > 0.99)
        assert own.sum() > 50
        outer = shade(color, normal[None], to_viewer, to_light, look)[0]
        for cast, face in ((lit, outer), (unlit, color[0])):
            rgba = cast.rgba.cpu()[own]
            expected = opacity * face + (rgba[:, 3:] - opacity) * inner
            torch.testing.assert_close(rgba[:, :3].double(), expected, rtol=0, atol=2e-3)
        torch.testing.assert_close(
            lit.normal.cpu()[own].double(), (opacity * normal).expand(own.sum(), 3), rtol=0, atol=0.05
        )


@pytest.mark.parametrize("is_lit", [True, False])
def test_faces_beside_samples_that_are_none_are_finite(is_lit, device):
    """Sums take vectors of samples, whose last one is not full: other lanes hold what was there before."""
    values = np.random.default_rng(0).random((20, 20, 20), np.float32)
    values[::5, ::5, ::5] = np.nan
    tf = TransferFunction([(0.2, 0.0), (0.5, 0.3), (0.9, 0.0)], [(0.0, 1.0, 0.0, 0.0), (1.0, 0.0, 0.0, 1.0)])
    camera = orbit(20, 10, 1.5, 60, 100, 100)
    cut = planes([[1.0, 0.0, 0.0]], [0.1], camera, device)
    cast = Caster(Grid(values), Appearance(), device).cast(
        tf, camera, HEADLIGHT, depth_range=cut.depth_range, faces=cut, lit_faces=is_lit
    )
    assert (cast.rgba[..., 3] > 0).sum() > 2000
    assert cast.rgba.isfinite().all()


@pytest.mark.parametrize(("error", "message", "change"), [
    (ShapeError, r"depth_range: expected \[2, 50, 60\], got \[2\]", {"depth_range": torch.zeros(2)}),
    (ArgumentError, "view: expected depth ranges and planes with faces", {"depth_range": None}),
    (ShapeError, r"faces.face: expected \[50, 60\], got \[2, 2\]", {"face": torch.zeros(2, 2).int()}),
    (ArgumentError, "faces.normals: expected float32", {"normals": torch.zeros(1, 3).double()}),
])  # fmt: skip
def test_mistakes_are_named(error, message, change):
    cut = planes([[0.0, 0.0, 1.0]], [0.0], CAMERA, "cpu")
    faces = cut._replace(**{name: x for name, x in change.items() if name in ("face", "normals")})
    change = {name: x for name, x in change.items() if name == "depth_range"}
    with pytest.raises(error, match=message):
        Caster(ball(8), Appearance()).cast(
            SHELLS, CAMERA, HEADLIGHT, **{"depth_range": cut.depth_range, "faces": faces, **change}
        )
