"""Changes of a voxel grid's colours that are exact for every ray: an affine map, and no view dependence."""

from __future__ import annotations

import torch
from torch import Tensor

from texgs.core import check
from texgs.raster.spherical_harmonics import Y00
from texgs.raster.voxel_grid import VoxelGrid, pack_rows, unpack_rows

GREY = 0.5  # colour of coefficients that are 0


@torch.no_grad()
def recolored(grid: VoxelGrid, matrix: Tensor, offset: Tensor) -> VoxelGrid:
    """Return a grid whose every colour c is matrix @ c + offset, wherever neither is clamped to 0.

    Colour is 0.5 + Y00 s_0 + sum_k Y_k s_k. So the coefficients s_k become A s_k, and s_0 becomes
    A s_0 + (0.5 A 1 + b - 0.5) / Y00; ARF's own colour transfer leaves the last term as b. Voxels without a
    row change as well, so that the colours between them and others do. The background is the caller's.

    Args:
        grid: any.
        matrix: A, [3, 3].
        offset: b, [3].

    Raises:
        ShapeError: if a shape is another.
    """
    check.shape("matrix", matrix, "3 3")
    check.shape("offset", offset, "3")
    density, sh = unpack_rows(grid.rows)
    sh = sh @ matrix.T
    sh[:, 0] += (GREY * matrix.sum(1) + offset - GREY) / Y00
    return grid.with_rows(pack_rows(density, sh))


@torch.no_grad()
def drop_sh(grid: VoxelGrid) -> VoxelGrid:
    """Return a grid with the zeroth harmonic alone: colours that are the same from everywhere."""
    return grid.with_rows(grid.rows[:, :4])
