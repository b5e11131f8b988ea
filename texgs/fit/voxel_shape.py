"""Which voxels a grid has: the visual hull at first, later what is seen, and that twice as fine."""

from __future__ import annotations

from math import ceil

import torch
from torch import Tensor

from texgs.core.errors import ArgumentError
from texgs.fields.voxels.rays import TrainingRays, widened
from texgs.fit.hull import Box, is_covered
from texgs.raster.voxel_grid import VoxelGrid, interpolate_rows, pack_rows, voxel_grid
from texgs.raster.voxels import March, Samples
from texgs.volume.images import Images

SEARCHED = 64  # voxels along a side of the cube that is searched for the object
PIECE = 16_384  # rays at a time
SIDE = 8  # voxels that the sides of the coarsest grid are multiples of


def hull_grid(images: Images, side: int, half_size: float, degree: int, density: float) -> VoxelGrid:
    """A grey grid that fills the visual hull, in a box that just holds it.

    Args:
        images: training views with alpha.
        side: voxels along the longest side of the box.
        half_size: half the side of the cube around the origin that is searched, world units.
        degree: of the spherical harmonics.
        density: of all voxels, per world unit.
    """
    low, high = hull_box(images, half_size)
    spacing = float((high - low).max()) / (side - 1)
    size = [SIDE * ceil((float(extent) / spacing + 1) / SIDE) for extent in high - low]
    mask = in_hull(images, lattice(size, low, spacing), spacing).reshape(size)
    grid = voxel_grid(mask, low.tolist(), spacing, degree)
    filled = pack_rows(torch.full((len(grid),), density), torch.zeros(len(grid), (degree + 1) ** 2, 3))
    return grid.with_rows(torch.cat([grid.rows[:1], filled]))


def hull_box(images: Images, half_size: float) -> Box:
    """The box around the visual hull in a cube around the origin."""
    spacing = 2 * half_size / SEARCHED
    low = torch.full((3,), -half_size + spacing / 2)
    points = lattice([SEARCHED] * 3, low, spacing)
    inside = points[in_hull(images, points, spacing)]
    if not len(inside):
        raise ArgumentError(
            f"visual hull: expected points that every view shows within {half_size} of the origin, found "
            "none; do the views show anything there, and do their cameras agree?"
        )
    return inside.amin(0) - spacing, inside.amax(0) + spacing


def lattice(size: list[int], low: Tensor, spacing: float) -> Tensor:
    """World positions [X Y Z, 3] of all voxels."""
    return low + spacing * torch.cartesian_prod(*map(torch.arange, size))


def in_hull(images: Images, points: Tensor, spacing: float) -> Tensor:
    """Whether each of points [n, 3] is within about a spacing of something visible, in every view."""
    left = torch.arange(len(points))
    for index, camera in enumerate(images.cameras):
        nearest = float((points[left] - camera.position).norm(dim=1).amin()) if len(left) else 1.0
        pixels = min(
            ceil(0.5 * float(camera.K[0, 0]) * spacing / max(nearest, spacing)), min(images.size) // 2
        )
        alpha = widened(images.planes[index, 3], pixels)
        left = left[is_covered(alpha, camera, points[left])]
    inside = torch.zeros(len(points), dtype=torch.bool)
    inside[left] = True
    return inside


def seen_voxels(grid: VoxelGrid, rays: TrainingRays, march: March, weight: float, share: float) -> Tensor:
    """Voxels [X, Y, Z] next to which a sample of some training rays has a larger weight than `weight`."""
    weights = torch.zeros(len(grid.rows))
    every = max(round(1 / share), 1)
    for start in range(0, len(rays), every * PIECE):  # runs of neighbours, spread over all views
        ids = torch.arange(start, min(start + PIECE, len(rays)))
        Samples(grid, march, rays.take(ids)[0]).mark(weights)
    return (weights > weight)[grid.links().long()]


def refined(grid: VoxelGrid, kept: Tensor) -> VoxelGrid:
    """A grid with half the spacing, of the voxels around those to keep, [X, Y, Z] bool.

    Its rows are interpolated; every other one is a row as it was.
    """
    mask = kept
    for axis in range(3):
        mask = mask.repeat_interleave(2, axis)
    finer = voxel_grid(grown(mask), grid.lower, grid.spacing / 2, grid.degree)
    finer.rows[0] = grid.rows[0]
    interpolate_rows(grid, finer.points(), out=finer.rows[1:])
    finer.refresh()
    return finer


def grown(mask: Tensor) -> Tensor:
    """A mask [X, Y, Z] with all 26 neighbours of what is in it."""
    for axis, side in enumerate(mask.shape):
        before, mask = mask, mask.clone()
        mask.narrow(axis, 0, side - 1).logical_or_(before.narrow(axis, 1, side - 1))
        mask.narrow(axis, 1, side - 1).logical_or_(before.narrow(axis, 0, side - 1))
    return mask
