"""Voxel grids: their layout, changes of their colours, lazy optimisers and total variation."""

import math

import pytest
import torch

from tests.raster.voxel_scenes import LOWER, SPACING, voxel_scene
from tests.refusals import refused
from texgs.core.errors import DeviceError, ShapeError
from texgs.raster.reference.voxels import interpolate
from texgs.raster.voxel_grid import drop_sh, interpolate_rows, pack_rows, recolor, unpack_rows, voxel_grid
from texgs.raster.voxel_optimizer import (
    EPSILON,
    VoxelOptimizer,
    VoxelRates,
    add_total_variation,
    add_variation_of_some,
)
from texgs.raster.voxels import March, RowGradient, render_rays

MATRIX = torch.tensor([[0.8, 0.2, 0.0], [0.1, 0.5, -0.2], [0.0, 0.3, 0.9]])
OFFSET = torch.tensor([0.1, 0.3, -0.05])


def test_rows_are_packed_and_unpacked():
    for count in (1, 4, 9):
        density, sh = torch.rand(5), torch.rand(5, count, 3)
        for a, b in zip(unpack_rows(pack_rows(density, sh)), (density, sh), strict=True):
            assert torch.equal(a, b)


def test_links_and_points_agree_with_the_mask():
    mask = torch.rand(8, 12, 16, generator=torch.Generator().manual_seed(0)) < 0.3
    grid = voxel_grid(mask, LOWER, SPACING)
    links = grid.links()
    assert torch.equal(links > 0, mask)
    assert torch.equal(links[mask].sort().values, torch.arange(1, len(grid) + 1, dtype=torch.int32))
    places = ((grid.points() - torch.tensor(LOWER)) / SPACING).round().long()
    assert torch.equal(links[tuple(places.T)], torch.arange(1, len(grid) + 1, dtype=torch.int32))


def test_interpolated_rows():
    scene = voxel_scene()
    grid = scene.grid
    at = torch.rand(50, 3, generator=torch.Generator().manual_seed(0)) * (torch.tensor(grid.size) - 1)
    points = torch.tensor(LOWER) + SPACING * at
    # A point is rounded to about 1e-6 of a cell, over which a row changes by up to 2e-5.
    expected = interpolate(grid.rows[grid.links().long()], at[None])[0]
    torch.testing.assert_close(interpolate_rows(grid, points), expected, rtol=1e-4, atol=5e-5)
    assert not interpolate_rows(grid, torch.tensor([[9.0, 9.0, 9.0]])).any()


def test_occupied_cells_and_distances(device):
    grid = voxel_scene(size=(32, 8, 16), filled=0.003).grid.to(device)
    grid.refresh_occupancy()
    grid = grid.to("cpu")
    dense = (grid.density[grid.links().long()] > 0).double()
    cells = torch.nn.functional.max_pool3d(torch.nn.functional.pad(dense, (0, 1) * 3)[None], 2, 1)[0] > 0
    assert torch.equal(voxel_grid(cells, LOWER, SPACING).masks, grid.occupied)
    some = (grid.occupied != 0).nonzero()
    place = torch.stack(torch.meshgrid(*map(torch.arange, grid.masks.shape), indexing="ij"), -1)
    distance = (place[..., None, :] - some).abs().amax(-1).amin(-1)
    assert torch.equal(grid.distance, distance.to(torch.uint8))


@pytest.mark.parametrize("degree", [0, 1, 2])
def test_an_affine_map_of_colours(degree, device):
    scene = voxel_scene(degree=degree).to(device)
    grid = scene.grid
    quads = grid.rows.unflatten(1, (-1, 4))
    quads[:, :, :3] *= 0.1  # colours near 0.5, that no map clamps
    quads[:, 1:4, 3] *= 0.1
    matrix, offset = MATRIX.to(device), OFFSET.to(device)
    changed = recolor(grid, matrix, offset)
    before = render_rays(grid, scene.rays, March((0.0, 0.0, 0.0)))
    after = render_rays(changed, scene.rays, March((0.0, 0.0, 0.0)))
    expected = before.color @ matrix.T + before.alpha[:, None] * offset
    assert before.alpha.max() > 0.9
    torch.testing.assert_close(after.color, expected, rtol=1e-5, atol=2e-6)
    assert torch.equal(after.alpha, before.alpha)
    same = recolor(grid, torch.eye(3).to(matrix), torch.zeros_like(offset))
    torch.testing.assert_close(same.rows, grid.rows)


def test_dropped_harmonics():
    scene = voxel_scene()
    flat = drop_sh(scene.grid)
    assert flat.degree == 0
    density, sh = unpack_rows(scene.grid.rows)
    found_density, found_sh = unpack_rows(flat.rows)
    assert torch.equal(found_density, density)
    assert torch.equal(found_sh, sh[:, :1])


def test_what_makes_no_grid():
    mask, grid, wide = torch.ones(8, 8, 8, dtype=torch.bool), voxel_scene().grid, torch.zeros(3, 4)
    for given in ((mask[:, :6], LOWER, SPACING), (mask.float(), LOWER, SPACING)):
        refused(lambda given=given: voxel_grid(*given), "bool", ShapeError)
    refused(lambda: voxel_grid(mask, LOWER, SPACING, 3), "degree: ")
    for spacing in (0, -1, math.inf, math.nan):
        refused(lambda spacing=spacing: voxel_grid(mask, LOWER, spacing), "spacing: ")
    for lower in (LOWER[:2], (0, 0, math.nan)):
        refused(lambda lower=lower: voxel_grid(mask, lower, SPACING), "lower: ")
    refused(lambda: grid.with_rows(grid.rows.to("meta")), "rows: ", DeviceError)
    for rows in (torch.zeros(3, 32), torch.zeros(len(grid.rows), 8)):
        refused(lambda rows=rows: grid.with_rows(rows), "rows: ", ShapeError)
    refused(lambda: recolor(grid, wide, OFFSET), "matrix: ", ShapeError)
    refused(lambda: recolor(grid, MATRIX, torch.zeros(1)), "offset: ", ShapeError)


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
