"""Recolouring of voxel grids, on rendered rays."""

import pytest
import torch

from tests.raster.requirements import refuses
from tests.raster.voxel_scenes import voxel_scene
from texgs.core.errors import ShapeError
from texgs.raster.voxel_grid import drop_sh, recolored, unpack_rows
from texgs.raster.voxels import March, render_rays

MATRIX = torch.tensor([[0.8, 0.2, 0.0], [0.1, 0.5, -0.2], [0.0, 0.3, 0.9]])
OFFSET = torch.tensor([0.1, 0.3, -0.05])


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


def test_the_identity_changes_nothing():
    grid = voxel_scene().grid
    torch.testing.assert_close(recolored(grid, torch.eye(3), torch.zeros(3)).rows, grid.rows)


def test_dropped_harmonics():
    scene = voxel_scene()
    flat = drop_sh(scene.grid)
    assert flat.degree == 0
    density, sh = unpack_rows(scene.grid.rows)
    found_density, found_sh = unpack_rows(flat.rows)
    assert torch.equal(found_density, density)
    assert torch.equal(found_sh, sh[:, :1])


def test_errors_name_the_argument():
    grid = voxel_scene().grid
    with pytest.raises(ShapeError, match=r"matrix: expected \[3, 3\], got \[3, 4\]"):
        recolored(grid, torch.zeros(3, 4), OFFSET)
    refuses(ShapeError, r"offset: expected \[3\], got \[1\]", recolored, grid, MATRIX, torch.zeros(1))
