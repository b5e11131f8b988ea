"""What a palette field starts from: where a voxel grid shows anything, and a palette of the views."""

from __future__ import annotations

from dataclasses import replace

import torch
from torch import Tensor

from texgs.core.errors import FitError
from texgs.fields.palette.colors import cluster_colors
from texgs.fields.palette.rendering import Geometry
from texgs.fit.voxel_shape import seen_voxels
from texgs.fit.voxels import VoxelFit
from texgs.raster.hash_encoding import HashLevels
from texgs.raster.voxel_grid import interpolate_rows, pack_rows, voxel_grid
from texgs.volume.images import Images

OPAQUE = 128  # of 255: alpha from which a pixel tells a colour
TRUSTED = 0.5  # of the grid's densities, for where rays may end
LEAST_DENSITY = 0.1  # of its voxels, so that points of rays are there


def places(fit: VoxelFit, levels: HashLevels, step: float) -> Geometry:
    """Voxels that show in the training views: networks are looked at only in cells next to them."""
    s, grid = fit.settings, fit.grid
    seen = seen_voxels(grid, fit.rays, fit.march, s.prune_weight, s.prune_share)
    if not seen.any():
        raise FitError("voxels: expected some that show in the views, found none; lower prune_weight")
    around = voxel_grid(seen, grid.lower, grid.spacing, 0)
    values = (TRUSTED * interpolate_rows(grid, around.points())[:, 3]).clamp_min(LEAST_DENSITY)
    rows = torch.cat([around.rows[:1], pack_rows(values, torch.zeros(len(values), 1, 3))])
    return Geometry(around.with_rows(rows), replace(fit.march, step=step), levels)


def object_palette(images: Images, count: int, seed: int) -> Tensor:
    """Clusters [count, 3] of the colours of all pixels that are opaque enough, or of the most opaque ones."""
    alpha = images.planes[:, 3]
    opaque = alpha >= min(int(alpha.max()), OPAQUE)
    share = alpha[opaque, None].float() / 255
    colors = images.planes.permute(0, 2, 3, 1)[opaque][:, :3].float() / 255
    return cluster_colors(((colors - 1 + share) / share).clamp(0, 1), count, seed)
