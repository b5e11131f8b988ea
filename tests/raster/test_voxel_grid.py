"""The layout of voxel grids, and changes of their colours on rendered rays."""

import math

import pytest
import torch

from tests.raster.voxel_scenes import LOWER, SPACING, voxel_scene
from tests.refusals import refused
from texgs.core.errors import DeviceError, ShapeError
from texgs.raster.reference.voxels import interpolate
from texgs.raster.voxel_grid import drop_sh, interpolate_rows, pack_rows, recolored, unpack_rows, voxel_grid
from texgs.raster.voxels import March, render_rays

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
    at = torch.rand(50, 3) * (torch.tensor(grid.size) - 1)
    points = torch.tensor(LOWER) + SPACING * at
    expected = interpolate(grid.rows[grid.links().long()], at[None])[0]
    torch.testing.assert_close(interpolate_rows(grid, points), expected, rtol=1e-4, atol=1e-5)
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
    changed = recolored(grid, matrix, offset)
    before = render_rays(grid, scene.rays, March((0.0, 0.0, 0.0)))
    after = render_rays(changed, scene.rays, March((0.0, 0.0, 0.0)))
    expected = before.color @ matrix.T + before.alpha[:, None] * offset
    assert before.alpha.max() > 0.9
    torch.testing.assert_close(after.color, expected, rtol=1e-5, atol=2e-6)
    assert torch.equal(after.alpha, before.alpha)
    same = recolored(grid, torch.eye(3).to(matrix), torch.zeros_like(offset))
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
    refused(lambda: recolored(grid, wide, OFFSET), "matrix: ", ShapeError)
    refused(lambda: recolored(grid, MATRIX, torch.zeros(1)), "offset: ", ShapeError)
