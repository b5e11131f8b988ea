"""Voxel grids give the same bits for any number of threads."""

import pytest
import torch

from tests.raster.threads import with_threads
from tests.raster.voxel_scenes import voxel_scene
from texgs.raster import native
from texgs.raster.voxel_optimizer import VoxelOptimizer, VoxelRates, add_total_variation
from texgs.raster.voxels import Samples, render_rays


def everything(degree, size=(64, 40, 36), n_rays=20_000):
    """A rendering, its gradient, the largest weights, total variation and a step of the optimiser."""
    scene = voxel_scene(size=size, degree=degree, n_rays=n_rays)
    rows = scene.grid.rows.requires_grad_()
    rendered = render_rays(scene.grid, scene.rays, scene.march)
    gradient = torch.autograd.grad(rendered.color.square().sum() + rendered.alpha.sum(), rows)[0]
    weights = torch.zeros(len(rows))
    Samples(scene.grid, scene.march, scene.rays).mark(weights)
    rows.requires_grad_(False)
    optimizer = VoxelOptimizer(scene.grid, "adam")
    Samples(scene.grid, scene.march, scene.rays).add_gradient(rendered.color, None, optimizer.gradient)
    add_total_variation(scene.grid, torch.arange(20), 1.0, 1.0, optimizer.gradient)
    optimizer.step(VoxelRates(1.0, 0.1, 0.1))
    scene.grid.refresh_occupancy()
    return [*rendered, gradient, weights, rows.clone(), scene.grid.occupied, scene.grid.distance]


@pytest.mark.parametrize("degree", [0, 2])
def test_threads(degree):
    alone = with_threads(1, everything, degree)
    for count in (2, 7):
        for a, b in zip(with_threads(count, everything, degree), alone, strict=True):
            assert torch.equal(a, b)


def test_runs():
    for a, b in zip(everything(1), everything(1), strict=True):
        assert torch.equal(a, b)


def test_memory_is_given_back():
    everything(0)
    native.release_memory()
    native.peak_memory(reset=True)
    assert native.peak_memory() == 0
