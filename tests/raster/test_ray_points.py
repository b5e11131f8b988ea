"""Points along rays are those that rendering blends: with their densities they give its alpha."""

import pytest
import torch

from tests.raster.requirements import require_same_bits
from tests.raster.voxel_scenes import SPACING, voxel_scene
from texgs.core.errors import DeviceError
from texgs.raster.voxel_grid import interpolate_rows
from texgs.raster.voxels import March, ray_points, render_rays


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


def test_rays_may_be_a_view_with_gaps():
    scene = voxel_scene(degree=0)
    strided, expected = (
        ray_points(scene.grid, rays, March()) for rays in (scene.rays[::2], scene.rays[::2].clone())
    )
    assert len(expected.points) > 0
    assert all(map(torch.equal, strided, expected))


def test_threads():
    scene = voxel_scene(degree=0, size=(64, 40, 36), n_rays=5000)
    require_same_bits(ray_points, scene.grid, scene.rays, March())


def test_other_devices_are_one_sentence():
    scene = voxel_scene(degree=0)
    with pytest.raises(DeviceError, match="rays: expected a tensor on cpu, got meta"):
        ray_points(scene.grid, scene.rays.to("meta"), March())
