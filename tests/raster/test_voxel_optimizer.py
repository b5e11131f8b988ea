"""The lazy optimisers of voxel grids and total variation against their definitions in torch."""

import pytest
import torch

from tests.raster.voxel_scenes import voxel_scene
from tests.refusals import refused
from texgs.core.errors import DeviceError, ShapeError
from texgs.raster.voxel_grid import voxel_grid
from texgs.raster.voxel_optimizer import (
    EPSILON,
    VoxelOptimizer,
    VoxelRates,
    add_total_variation,
    add_variation_of_some,
)
from texgs.raster.voxels import RowGradient, render_rays

RATES = VoxelRates(density=3.0, base=0.2, sh=0.05)


def rate_row(floats):
    """The rate of each float of a row."""
    rates = torch.full((floats,), RATES.sh)
    rates[:3], rates[3] = RATES.base, RATES.density
    return rates


def sparse_gradient(grid, seed):
    """A gradient that half of the rows have, in its blocks; in some floats it is 0."""
    generator = torch.Generator().manual_seed(seed)
    gradient = torch.randn(grid.rows.shape, generator=generator)
    gradient[torch.rand(len(gradient), generator=generator) < 0.5] = 0
    gradient[torch.rand(gradient.shape, generator=generator) < 0.1] = 0
    gradient[0] = 0
    return gradient


@pytest.mark.parametrize("kind", ["rmsprop", "adam"])
@pytest.mark.parametrize("degree", [0, 1, 2])
def test_steps(kind, degree, device):
    grid = voxel_scene(degree=degree).grid.to(device)
    expected = grid.rows.double()
    optimizer = VoxelOptimizer(grid, kind)
    beta1, beta2 = optimizer.betas
    first, second = torch.zeros_like(expected), torch.zeros_like(expected)
    for seed in range(3):
        gradient = sparse_gradient(grid, seed).to(device)
        optimizer.gradient.rows.copy_(gradient)
        optimizer.gradient.touched.fill_(1)
        optimizer.step(RATES)
        g, moved = gradient.double(), (gradient != 0).any(1, keepdim=True)
        fresh = second == 0
        first = torch.where(moved, torch.where(fresh, g, beta1 * first + (1 - beta1) * g), first)
        second = torch.where(moved, torch.where(fresh, g**2, beta2 * second + (1 - beta2) * g**2), second)
        towards = first if kind == "adam" else g
        step = rate_row(grid.rows.shape[1]).to(device) * towards / (second.sqrt() + EPSILON)
        expected = expected - torch.where(moved, step, 0)
    torch.testing.assert_close(grid.rows.double(), expected, rtol=1e-5, atol=1e-5)
    assert torch.equal(grid.density, grid.rows[:, 3])
    assert not optimizer.gradient.rows.any()
    assert not optimizer.gradient.touched.any()


def test_blocks_that_were_not_touched_stay(device):
    grid = voxel_scene().grid.to(device)
    before = grid.rows.clone()
    optimizer = VoxelOptimizer(grid)
    optimizer.gradient.rows.fill_(1.0)
    optimizer.gradient.touched[0] = 1
    optimizer.step(RATES)
    in_block = grid.links()[:4, :4, :4].flatten().long()
    in_block = in_block[in_block > 0]
    assert (grid.rows[in_block] != before[in_block]).all()
    grid.rows[in_block] = before[in_block]
    assert torch.equal(grid.rows, before)
    optimizer.gradient.rows[5, 2] = float("nan")
    optimizer.gradient.touched.fill_(1)
    optimizer.step(RATES)
    assert grid.rows[5, 2].isnan(), "a gradient that is not finite is not hidden"


@pytest.mark.parametrize("degree", [0, 1, 2])
def test_total_variation(degree, device):
    grid = voxel_scene(degree=degree).grid
    blocks = torch.tensor([0, 7, 3])
    there = grid.to(device)
    into = RowGradient(there)
    add_total_variation(there, blocks.to(device), 0.3, 0.7, into)

    rows = grid.rows.double().requires_grad_()
    links = grid.links().long()
    own = torch.zeros(grid.masks.shape).flatten().index_fill(0, blocks, 1).reshape(grid.masks.shape)
    for axis in range(3):
        own = own.repeat_interleave(4, axis)
    own = (own > 0) & (links > 0)
    total = 1e-9
    for axis in range(3):
        following = torch.zeros_like(links)
        side = links.shape[axis] - 1
        following.narrow(axis, 0, side).copy_(links.narrow(axis, 1, side))
        has_next = (following > 0)[own][:, None]
        total = total + torch.where(has_next, rows[following[own]] - rows[links[own]], 0) ** 2
    weights = torch.full((grid.rows.shape[1],), 0.7).double()
    weights[3] = 0.3
    (total.sqrt() * weights).sum().backward()
    assert (into.rows.cpu() - rows.grad).norm() <= 1e-5 * rows.grad.norm()
    rows_of_blocks = links.unfold(0, 4, 4).unfold(1, 4, 4).unfold(2, 4, 4).reshape(-1, 64)
    changed = (rows.grad[rows_of_blocks] != 0).any(-1).any(-1)
    assert not (changed & ~into.touched.bool().cpu()).any()


def test_a_backward_pass_after_a_step_is_refused():
    scene = voxel_scene(degree=0)
    grid = scene.grid.with_rows(scene.grid.rows.clone().requires_grad_())
    optimizer = VoxelOptimizer(grid)
    color = render_rays(grid, scene.rays).color
    optimizer.step(RATES)
    refused(color.sum().backward, "modified by an inplace operation", RuntimeError)


def test_a_grid_without_voxels_has_no_variation():
    grid = voxel_grid(torch.zeros(8, 8, 8, dtype=torch.bool), (0.0, 0.0, 0.0), 1.0, 0)
    into = RowGradient(grid)
    add_variation_of_some(grid, 1.0, 1.0, torch.Generator(), into)
    assert not into.rows.any()


def test_errors_name_the_argument():
    grid = voxel_scene().grid
    other, own = RowGradient(voxel_scene(size=(8, 8, 8)).grid), RowGradient(grid)
    away, below = torch.tensor([0]).to("meta"), torch.tensor([-1])
    refused(lambda: VoxelOptimizer(grid, "sgd"), "optimizer: .*'sgd'")
    refused(lambda: add_total_variation(grid, torch.tensor([0]), 1.0, 1.0, other), "into: ", ShapeError)
    refused(lambda: add_total_variation(grid, away, 1.0, 1.0, own), "blocks: ", DeviceError)
    refused(lambda: add_total_variation(grid, below, 1.0, 1.0, own), "blocks: ")
