"""Voxel grids against the dense definition: images, gradients, memory, errors."""

from dataclasses import replace

import pytest
import torch

from tests.raster.voxel_scenes import LOWER, SPACING, voxel_scene
from tests.refusals import refused
from texgs.core.camera import orbit
from texgs.core.errors import ArgumentError, DeviceError, ShapeError
from texgs.raster.voxel_grid import interpolate_rows, pack_rows, unpack_rows, voxel_grid
from texgs.raster.voxels import (
    March,
    Rays,
    RowGradient,
    Samples,
    camera_rays,
    ray_points,
    render_rays,
    render_view,
)


def gradients(scene, outputs, inputs, seed=1):
    """Gradients of a random combination of colour and alpha."""
    generator = torch.Generator().manual_seed(seed)
    cotangents = [torch.randn(x.shape, generator=generator).to(x) for x in outputs[:2]]
    return torch.autograd.grad(outputs[:2], inputs, cotangents)


@pytest.mark.parametrize("degree", [0, 1, 2])
@pytest.mark.parametrize("transmittance_min", [0.0, 0.05])
def test_image_and_gradient(degree, transmittance_min, device):
    scene = voxel_scene(degree, degree=degree, transmittance_min=transmittance_min).to(device)
    rows = scene.grid.rows.requires_grad_()
    rendered = render_rays(scene.grid, scene.rays, scene.march)
    leaves = [scene.density.double().requires_grad_(), scene.sh.double().requires_grad_()]
    expected = scene.definition(*leaves)
    for name, a, b in zip(rendered._fields, rendered, expected, strict=True):
        torch.testing.assert_close(a.double(), b, rtol=1e-4, atol=2e-5, msg=name)  # float32 places in cells
    (gradient,) = gradients(scene, rendered, [rows])
    density, sh = unpack_rows(gradient[1:])
    for a, b in zip((density, sh), gradients(scene, expected, leaves), strict=True):
        assert (a - b).norm() <= 2e-5 * b.norm()  # float32
    assert not gradient[0].any()


def test_definition_by_finite_differences():
    scene = voxel_scene(size=(8, 8, 8), degree=1, n_rays=8)
    scene.rays = scene.rays.double()
    leaves = (scene.density.double().requires_grad_(), scene.sh.double().requires_grad_())
    assert torch.autograd.gradcheck(lambda d, s: scene.definition(d, s)[:2], leaves, fast_mode=True)


def test_a_slab_by_hand(device):
    grid = voxel_grid(torch.ones(8, 8, 8, dtype=torch.bool), (0, 0, 0), 0.5)
    sh = torch.zeros(512, 9, 3)
    sh[:, 0] = torch.tensor([0.0, 1.0, -5.0])
    grid = grid.with_rows(torch.cat([torch.zeros(1, 32), pack_rows(torch.full((512,), 0.3), sh)]))
    rays = torch.tensor([[1.7, 2.1, -3.0, 0.0, 0.0, 2.0], [9.0, 9.0, 9.0, 1.0, 0.0, 0.0]])
    out = Rays(*(x.cpu() for x in render_rays(grid.to(device), rays.to(device))))
    alpha = 1 - torch.exp(torch.tensor(-0.3 * 3.5))  # seven cells of half a unit
    color = torch.tensor([0.5, 0.5 + 0.28209479, 0.0])
    torch.testing.assert_close(out.alpha, torch.stack([alpha, torch.tensor(0.0)]))
    torch.testing.assert_close(out.color, torch.stack([alpha * color + 1 - alpha, torch.ones(3)]))
    assert 3.0 < out.distance[0] < 4.75  # in front of the middle of the slab: nearer samples weigh more
    assert out.distance[1] == 0


def test_samples_that_are_used_twice(device):
    scene = voxel_scene().to(device)
    rows = scene.grid.rows.requires_grad_()
    color = render_rays(scene.grid, scene.rays, scene.march).color
    first = torch.autograd.grad(color.sum(), rows, retain_graph=True)[0]
    assert torch.equal(torch.autograd.grad(color.sum(), rows)[0], first)


def test_gradient_into_a_buffer(device):
    scene = voxel_scene().to(device)
    rows = scene.grid.rows.requires_grad_()
    into = RowGradient(scene.grid)
    ones = torch.ones(len(scene.rays), 3, device=device)
    Samples(scene.grid, scene.march, scene.rays).add_gradient(ones, None, into)
    assert rows.grad is None
    render_rays(scene.grid, scene.rays, scene.march).color.sum().backward()
    torch.testing.assert_close(into.rows, rows.grad)
    blocks = scene.grid.links().unfold(0, 4, 4).unfold(1, 4, 4).unfold(2, 4, 4).reshape(-1, 64).long()
    has_gradient = (rows.grad[blocks] != 0).any(-1).any(-1)
    assert not (has_gradient & ~into.touched.bool()).any()


def test_rows_without_gradient_keep_nothing():
    scene = voxel_scene()
    assert not render_rays(scene.grid, scene.rays, scene.march).color.requires_grad
    with torch.no_grad():
        scene.grid.rows.requires_grad_()
        assert not render_rays(scene.grid, scene.rays, scene.march).color.requires_grad


def test_largest_weights(device):
    scene = voxel_scene(n_rays=40).to(device)
    weights = torch.zeros(len(scene.grid.rows), device=device)
    Samples(scene.grid, scene.march, scene.rays).mark(weights)
    alone = torch.zeros_like(weights)
    for ray in scene.rays:
        one = torch.zeros_like(alone)
        Samples(scene.grid, scene.march, ray[None]).mark(one)
        alone = alone.maximum(one)
        alpha = render_rays(scene.grid, ray[None], scene.march).alpha
        assert one.max() <= alpha + 1e-6
        assert bool(one.any()) == bool(alpha > 0)
    assert torch.equal(weights, alone)
    lower = torch.zeros_like(weights) - 1  # they may start anywhere
    Samples(scene.grid, scene.march, scene.rays).mark(lower)
    assert torch.equal(lower.clamp_min(0), weights)
    assert lower.max() > 0 > lower.min()


def test_largest_weight_of_a_single_cell():
    mask = torch.zeros(8, 8, 8, dtype=torch.bool)
    mask[3:5, 3:5, 3:5] = True
    grid = voxel_grid(mask, (0, 0, 0), 1.0, 0)
    grid = grid.with_rows(torch.cat([torch.zeros(1, 4), torch.tensor([[0.0, 0, 0, 2]]).expand(8, 4)]))
    weights = torch.zeros(9)
    rays = torch.tensor([[3.5, 3.5, -2.0, 0.0, 0.0, 1.0]])
    Samples(grid, March(step=0.5), rays).mark(weights)
    # Samples a quarter and three quarters into the cells from 2 to 5 have densities .5, 1.5, 2, 2, 1.5, .5.
    light = torch.exp(-0.5 * torch.tensor([0, 0.5, 2.0, 4.0]))
    _, front, behind = light[:-1] - light[1:]
    links = grid.links()[3:5, 3:5, 3:5].long()
    torch.testing.assert_close(weights[links], torch.stack([front, behind]).expand(2, 2, 2))


def test_rays_of_a_camera():
    camera = orbit(30, 20, 4.0, 30, 7, 5)
    rays = camera_rays(camera)
    in_camera = (rays[..., :3] + rays[..., 3:]) @ camera.viewmat[:3, :3].T + camera.viewmat[:3, 3]
    pixels = in_camera @ camera.K.T
    expected = torch.stack(torch.meshgrid(torch.arange(7) + 0.5, torch.arange(5) + 0.5, indexing="xy"), -1)
    torch.testing.assert_close(pixels[..., :2], expected, rtol=0, atol=1e-4)
    torch.testing.assert_close(pixels[..., 2], torch.ones(5, 7))


def test_a_view_is_its_rays():
    scene = voxel_scene()
    camera = orbit(30, 20, 4.0, 30, 9, 7)
    view = render_view(scene.grid, camera, scene.march)
    rays = render_rays(scene.grid, camera_rays(camera).reshape(-1, 6), scene.march)
    assert torch.equal(view.color, rays.color.reshape(7, 9, 3))
    assert torch.equal(view.alpha, rays.alpha.reshape(7, 9))
    y, x = divmod(int(view.alpha.argmax()), 9)
    ray = camera_rays(camera)[y, x]
    point = ray[:3] + rays.distance[9 * y + x] * ray[3:] / ray[3:].norm()
    depth = (camera.viewmat[:3, :3] @ point + camera.viewmat[:3, 3])[2]
    torch.testing.assert_close(view.depth[y, x], depth)


def test_an_empty_grid_shows_the_background(device):
    grid = voxel_grid(torch.zeros(8, 8, 8, dtype=torch.bool, device=device), LOWER, SPACING)
    grid.rows.requires_grad_()
    rays = torch.tensor([[-0.5, -0.3, -9.0, 0.0, 0.0, 1.0]], device=device)
    out = render_rays(grid, rays, March((0.1, 0.2, 0.3)))
    assert torch.equal(out.color.cpu(), torch.tensor([[0.1, 0.2, 0.3]]))
    assert not torch.autograd.grad(out.color.sum(), grid.rows)[0].any()
    assert render_rays(grid, rays[:0]).color.shape == (0, 3)


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf")])
def test_rays_that_are_not_finite_bring_back_the_background(value, device):
    scene = voxel_scene().to(device)
    for column in range(6):
        rays = scene.rays[:6].clone()
        rays[:, column] = value
        color = render_rays(scene.grid, rays, scene.march).color
        assert torch.equal(color.cpu(), torch.tensor(scene.march.background).expand(6, 3))


@pytest.mark.parametrize("away", [1e4, 1e6, 1e7, 1e9, 1e30])
def test_rays_from_far_away_stay_inside_of_the_lattice(away, device):
    """Their places are lost in rounding; what they read must not be."""
    scene = voxel_scene().to(device)
    aims = torch.tensor([[1.0, 0.3, 0.2], [-0.2, 1.0, 0.1], [0.3, -0.1, 1.0], [1.0, 1.0, 1.0]], device=device)
    rays = torch.cat([torch.cat([-away * sign * aims, sign * aims], dim=1) for sign in (1, -1)])
    rows = scene.grid.rows.requires_grad_()
    rendered = render_rays(scene.grid, rays, scene.march)
    assert rendered.color.isfinite().all()
    assert ((rendered.alpha >= 0) & (rendered.alpha <= 1)).all()
    assert torch.autograd.grad(rendered.color.sum(), rows)[0].isfinite().all()


@pytest.mark.parametrize("transmittance_min", [0.0, 0.1])
def test_points_have_the_alpha_of_the_grid(transmittance_min):
    scene = voxel_scene(degree=0)
    march = March(step=0.4, transmittance_min=transmittance_min)
    points, ray = ray_points(scene.grid, scene.rays, march)
    density = interpolate_rows(scene.grid, points)[:, 3]
    depth = torch.zeros(len(scene.rays)).index_add_(0, ray, density * 0.4 * SPACING)
    alpha = render_rays(scene.grid, scene.rays, march).alpha
    torch.testing.assert_close(1 - torch.exp(-depth), alpha, atol=1e-4, rtol=1e-4)


def test_points_are_on_their_rays_front_to_back():
    scene = voxel_scene(degree=0)
    points, ray = ray_points(scene.grid, scene.rays, March(transmittance_min=0.0))
    origin, direction = scene.rays[ray, :3], torch.nn.functional.normalize(scene.rays[ray, 3:], dim=1)
    distance = ((points - origin) * direction).sum(1)
    torch.testing.assert_close(points, origin + distance[:, None] * direction, atol=1e-5, rtol=0)
    same = ray.diff() == 0
    assert bool((ray.diff() >= 0).all())
    assert bool((distance.diff()[same] > 0.49 * SPACING).all())
    views = scene.rays[::2], scene.rays[::2].clone()  # with gaps and without
    strided, expected = (ray_points(scene.grid, rays, March()) for rays in views)
    assert len(expected.points) > 0
    assert all(map(torch.equal, strided, expected))


def test_what_does_not_fit_is_refused():
    scene = voxel_scene()
    grid, rays, into, n = scene.grid, scene.rays, RowGradient(scene.grid), len(scene.grid.rows)
    away, gone = replace(grid, rows=grid.rows.to("meta")), rays.to("meta")
    kept, lost = Samples(grid, scene.march, rays), Samples(grid, March(), rays, keep=False)
    other, elsewhere = RowGradient(voxel_scene(size=(8, 8, 8)).grid), RowGradient(grid.to("meta"))
    for error, named, call in (
        (ShapeError, "rays: .*transpose", lambda: render_rays(grid, rays.T)),
        (ArgumentError, "rays: .*float64", lambda: render_rays(grid, rays.double())),
        (ArgumentError, "rays: .*differentiable", lambda: render_rays(grid, rays.clone().requires_grad_())),
        (ArgumentError, "step: ", lambda: render_rays(grid, rays, March(step=0.01))),
        (ArgumentError, "transmittance_min: ", lambda: render_rays(grid, rays, March(transmittance_min=1))),
        (DeviceError, "rows: .*meta", lambda: render_rays(grid, gone)),
        (DeviceError, "rays: .*cpu", lambda: ray_points(grid, gone, March())),
        (DeviceError, "got meta", lambda: render_rays(away, gone)),
        (ArgumentError, "samples: ", lambda: lost.add_gradient(torch.ones(len(rays), 3), None, into)),
        (ShapeError, "into: ", lambda: kept.add_gradient(None, None, other)),
        (DeviceError, "into: ", lambda: kept.add_gradient(None, None, elsewhere)),
        (ShapeError, "color: ", lambda: kept.add_gradient(rays[1:, :3], None, into)),
        (DeviceError, "color: ", lambda: kept.add_gradient(rays[:, :3].to("meta"), None, into)),
        (ArgumentError, "alpha: ", lambda: kept.add_gradient(None, rays[:, 0].double(), into)),
        (ShapeError, "weights: ", lambda: kept.mark(torch.zeros(3))),
        (ArgumentError, "weights: ", lambda: kept.mark(torch.zeros(n).double())),
        (ArgumentError, "weights: .*dense", lambda: kept.mark(torch.zeros(2 * n)[::2])),
    ):
        refused(call, named, error)
