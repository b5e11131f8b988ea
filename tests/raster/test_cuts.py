"""Planes as depth ranges of rays, and what the rasterizers draw of them."""

from dataclasses import replace

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch.nn.functional import normalize

from tests.raster.agreement import check_gradients, check_images, images
from tests.raster.requirements import require_equal, require_same_bits
from tests.raster.scenes import random_scene, textured_with_features
from tests.raster.voxel_scenes import LOWER, SPACING, voxel_scene
from tests.refusals import refused
from texgs.core.camera import orbit
from texgs.core.errors import ArgumentError, ShapeError
from texgs.raster import reference
from texgs.raster.api import cut_range, rasterize, splat
from texgs.raster.reference.render import cut_range as true_cut_range
from texgs.raster.types import Options
from texgs.raster.voxels import March, render_rays, render_view

EVERYWHERE = (-torch.inf, torch.inf)
THROUGH = Options(transmittance_min=0.0)  # no pixel ends


# -- Planes -------------------------------------------------------------------------------------------------


def random_planes(n, seed):
    """Normals [n, 3] of any length and offsets [n], around the origin."""
    generator = torch.Generator().manual_seed(seed)
    normals = torch.randn(n, 3, generator=generator)
    return normals, normals.norm(dim=1) * (torch.rand(n, generator=generator) - 0.1)


def cut(normals, offsets, camera, device):
    """The range and the faces, on the CPU."""
    return tuple(x.cpu() for x in cut_range(normals.to(device), offsets.to(device), camera.to(device)))


VIEWS = [(2.0, 0, 0), (2.0, -60, 20), (0.3, 75, -40), (0.05, 10, 80)]  # the last two among the planes


@pytest.mark.parametrize("n", [0, 1, 2, 6, 12])
@pytest.mark.parametrize(("radius", "azimuth", "polar"), VIEWS)
def test_ranges_are_those_of_the_definition(n, radius, azimuth, polar, device):
    camera, (normals, offsets) = orbit(azimuth, polar, radius, 40, 53, 37), random_planes(n, n)
    (near, far), face, unit = cut(normals, offsets, camera, device)
    rays = camera.rays().double()
    truth, true_face = true_cut_range(normals.double(), offsets.double(), camera.position.double(), rays)
    torch.testing.assert_close(unit, normalize(normals, dim=1))
    is_left, left = near < far, truth[0] < truth[1]
    both = is_left & left
    # an end may be off along a grazing ray, not across the plane
    slopes = (rays @ unit.double().mT).abs().amin(-1) if n else torch.ones(face.shape)
    for own, true in zip((near, far), truth, strict=True):
        torch.testing.assert_close(own.isinf()[both], true.isinf()[both])
        finite = both & true.isfinite()
        assert float(((own - true).abs() * slopes / (1 + true))[finite].max() if finite.any() else 0) < 1e-5
    assert float((is_left == left).double().mean()) > 0.999
    assert float((face == true_face).double().mean()) > 0.99


@given(seed=st.integers(0, 10_000), n=st.integers(0, 12), radius=st.sampled_from([0.0, 0.2, 0.8, 3.0]))
def test_what_is_kept_is_behind_all_planes(seed, n, radius):
    """By brute force: points along the rays, and the plane of a face passes through where its rays begin."""
    normals, offsets = random_planes(n, seed)
    camera = orbit(37.0 * seed, seed % 160 - 80, radius + 1e-3, 50, 9, 7)
    (near, far), face, unit = cut_range(normals, offsets, camera)
    z = 4 * torch.rand(7, 9, 50, generator=torch.Generator().manual_seed(seed)).double()
    rays, position = camera.rays().double(), camera.position.double()
    points = position + z[..., None] * rays[:, :, None]  # [7, 9, 50, 3]
    inside = offsets / normals.norm(dim=1) - points @ unit.double().mT  # [7, 9, 50, n] distances
    sure = (inside.abs() > 1e-4).all(-1)
    kept = (near[..., None] <= z) & (z < far[..., None])
    assert torch.equal(kept[sure], (inside > 0).all(-1)[sure])
    begins = position + near[..., None] * rays  # [7, 9, 3]
    for i in range(n):
        distance = begins[face == i] @ unit[i].double() - offsets[i] / normals[i].norm()
        assert (distance.abs() < 1e-4 * near[face == i].clamp_min(1)).all()  # single precision
        assert (near[face == i] > 0).all()


def test_bits_are_the_same_on_any_number_of_threads():
    camera, scene = orbit(20, 30, 2, 40, 130, 90), with_range(random_scene(5))
    require_same_bits(lambda: cut_range(*random_planes(7, 0), camera))
    require_same_bits(lambda: images(scene.render(rasterize, scene.outputs)))


@pytest.mark.parametrize(("error", "named", "normals", "offsets"), [
    (ShapeError, "normals: ", torch.zeros(3), torch.zeros(1)),
    (ShapeError, "offsets: ", torch.eye(3)[:1], torch.zeros(2)),
    (ArgumentError, "normals: .*float64", torch.eye(3)[:1].double(), torch.zeros(1)),
    (ArgumentError, "normals: .*got 13", torch.ones(13, 3), torch.ones(13)),
    (ArgumentError, "normals: .*finite", torch.zeros(1, 3), torch.zeros(1)),
    (ArgumentError, "normals: .*finite", torch.full((1, 3), torch.nan), torch.zeros(1)),
    (ArgumentError, "offsets: .*gradient", torch.eye(3)[:1], torch.zeros(1, requires_grad=True)),
])  # fmt: skip
def test_mistakes_about_planes_are_named(error, named, normals, offsets):
    refused(lambda: cut_range(normals, offsets, orbit(0, 0, 2, 40, 8, 8)), named, error)


# -- Surfels and 3D Gaussians -------------------------------------------------------------------------------


def with_range(scene, low=2.6, high=3.3, seed=0):
    """The scene with a random range in each pixel, nothing in some and all in others."""
    generator = torch.Generator().manual_seed(seed)
    ends = low + (high - low) * torch.rand(2, scene.height, scene.width, generator=generator)
    ends[:, :5, :7] = torch.tensor(EVERYWHERE)[:, None, None]
    return replace(scene, depth_range=ends)


def constant_range(scene, near, far):
    """The scene with one range for all pixels."""
    return replace(
        scene, depth_range=torch.tensor([near, far])[:, None, None].expand(2, scene.height, scene.width)
    )


def thin_range(scene, low=2.6, high=3.3, thickness=0.15):
    """The scene with a thin range that goes deeper from left to right; most primitives are in few blocks."""
    near = torch.linspace(low, high, scene.width).expand(scene.height, -1)
    return replace(scene, depth_range=torch.stack([near, near + thickness]))


@pytest.mark.parametrize("seed", range(3))
def test_a_thin_range_loses_no_fragment(device, drawn, seed):
    scene = thin_range(drawn(random_scene(seed, n=100)))
    check_images(scene, device)
    assert 0.05 < float((scene.render(rasterize).alpha > 0).float().mean()) < 0.95


@pytest.mark.parametrize("compared", [("color",), ("color", "depth", "median", "normal", "distortion")])
def test_what_is_drawn_and_its_gradients_are_those_of_the_definition(device, drawn, compared):
    scene = with_range(drawn(random_scene(4)))
    check_images(scene, device)
    check_gradients(scene, device, compared)


@pytest.mark.parametrize("wanted", [None, ("features",), ("texels", "base", "gain")])
def test_textures_within_a_range(device, wanted):
    scene = with_range(textured_with_features(random_scene(10), 3))
    check_images(scene, device)
    check_gradients(scene, device, wanted=wanted)


def test_splat_and_statistics_within_a_range(device, drawn):
    scene = constant_range(drawn(random_scene(2, n=250)), 2.8, 3.1)
    image = torch.rand(scene.height, scene.width, 3, generator=torch.Generator().manual_seed(0))
    expected, weights = reference.splat(image.double(), **scene.double().geometry())
    sums, total = splat(image.to(device), **scene.to(device).geometry())
    torch.testing.assert_close(sums.cpu().double(), expected, rtol=1e-3, atol=0.05)
    torch.testing.assert_close(total.cpu().double(), weights, rtol=1e-3, atol=0.05)
    statistics = scene.to(device).render(rasterize, ("statistics",)).statistics
    torch.testing.assert_close(statistics.weight_sum, total)


def test_a_range_of_everything_changes_no_bit(device, drawn):
    scene = drawn(random_scene(1)).to(device)
    everything = constant_range(scene, *EVERYWHERE).to(device)
    require_equal(*(images(each.render(rasterize, scene.outputs)) for each in (everything, scene)))


def test_two_halves_of_the_rays_join(device, drawn):
    scene = drawn(replace(random_scene(5), background=None)).to(device)
    whole, front, back = (
        constant_range(scene, near, far).to(device).render(rasterize, options=THROUGH)
        for near, far in (EVERYWHERE, (-torch.inf, 3.0), (3.0, torch.inf))
    )
    left = 1 - front.alpha
    torch.testing.assert_close(front.alpha + left * back.alpha, whole.alpha, rtol=0, atol=2e-5)
    if scene.scales.shape[1] == 3:  # surfels are blended in the order of their means, not of their fragments
        joined = front.color + left[..., None] * back.color
        torch.testing.assert_close(joined, whole.color, rtol=0, atol=2e-5)
    assert float(front.alpha.mean()) > 0.05
    assert float(back.alpha.mean()) > 0.05


@pytest.mark.parametrize(("error", "depth_range"), [
    (ShapeError, torch.zeros(2, 53, 37)),
    (ArgumentError, torch.zeros(2, 37, 53).double()),
    (ArgumentError, torch.zeros(2, 37, 53, requires_grad=True)),
])  # fmt: skip
def test_mistakes_about_ranges_are_named(error, depth_range):
    scene = replace(random_scene(), depth_range=depth_range)
    refused(lambda: scene.render(rasterize), "depth_range: ", error)


# -- Voxels -------------------------------------------------------------------------------------------------


def voxels_within(depth_range, **settings):
    """A scene of voxels whose rays have one range, or each its own."""
    scene = voxel_scene(3, **settings)
    return replace(scene, march=replace(scene.march, depth_range=depth_range.expand(2, len(scene.rays))))


def random_ranges(n=300):
    """Ranges [2, n] in lengths of the direction, some of them empty."""
    return 1.5 * torch.rand(2, n, generator=torch.Generator().manual_seed(1))


@pytest.mark.parametrize("degree", [0, 2])
def test_voxels_within_a_range_are_those_of_the_definition(device, degree):
    scene = voxels_within(random_ranges(), degree=degree)
    density, sh = (x.double().requires_grad_() for x in (scene.density, scene.sh))
    expected = scene.definition(density, sh)
    moved = scene.to(device)
    rows = moved.grid.rows.requires_grad_()
    march = replace(scene.march, depth_range=scene.march.depth_range.to(device))
    result = render_rays(moved.grid, moved.rays, march)
    for own, true in zip(result, expected, strict=True):
        assert float((own.cpu() - true).detach().abs().gt(2e-3).double().mean()) < 0.02  # samples at an end
    result.color.sum().backward()
    expected[0].sum().backward()
    own, true = rows.grad[1:, 3].cpu().double(), density.grad
    assert float((own - true).norm() / true.norm()) < 0.1
    assert 0.02 < float(expected[1].detach().mean()) < 0.9


def test_halves_of_rays_through_voxels_join(device):
    scene = voxel_scene(3, transmittance_min=0.0).to(device)
    parts = [torch.tensor(part)[:, None].to(device).expand(2, 300) for part in ((0, 0.8), (0.8, torch.inf))]
    dark = replace(scene.march, background=(0.0, 0.0, 0.0))
    whole = render_rays(scene.grid, scene.rays, dark)
    front, back = (render_rays(scene.grid, scene.rays, replace(dark, depth_range=part)) for part in parts)
    left = 1 - front.alpha
    torch.testing.assert_close(front.color + left[:, None] * back.color, whole.color, rtol=0, atol=2e-6)
    torch.testing.assert_close(front.alpha + left * back.alpha, whole.alpha, rtol=0, atol=2e-6)


def test_a_cut_shows_no_voxel_before_its_plane(device):
    grid = voxel_scene(3, filled=1.0).grid.to(device)
    middle = torch.tensor(LOWER) + SPACING * torch.tensor([8, 6, 10])
    camera = orbit(30, 20, 3, 40, 20, 16, middle.tolist())
    normal = normalize(camera.position - middle, dim=0)[None]
    seen = cut_range(normal.to(device), (normal @ middle).to(device), camera.to(device))
    view = render_view(grid, camera.to(device), March(step=0.1), depth_range=seen.depth_range)
    shown = view.alpha > 0
    assert shown.sum() > 50
    assert (view.depth[shown] >= seen.depth_range[0][shown] - 1e-4).all()
    turned = torch.zeros(2, 20, 16)
    refused(lambda: render_view(grid, camera.to(device), depth_range=turned), "depth_range: ", ShapeError)
