"""Points along rays where a sparse voxel grid has density, for fields of networks. On the CPU."""

from __future__ import annotations

from ctypes import c_int64
from typing import NamedTuple

import torch
from torch import Tensor

from texgs.core.errors import DeviceError
from texgs.raster import native
from texgs.raster.voxel_grid import NativeGrid, VoxelGrid
from texgs.raster.voxels import March, NativeMarch, Samples

native.declare("texgs_grid_count", "p", result=c_int64, stream=False)
native.declare("texgs_grid_points", "p", NativeGrid, NativeMarch, "pp")


class RayPoints(NamedTuple):
    """Points of several rays, ray by ray and front to back."""

    points: Tensor  # [m, 3] world
    ray: Tensor  # [m] int64: index of the ray


def ray_points(grid: VoxelGrid, rays: Tensor, march: March) -> RayPoints:
    """Return the samples of rays [N, 6] that `texgs.raster.voxels.render_rays` would blend.

    They lie `march.step` spacings apart where the grid's density is above 0, and end where less light than
    `march.transmittance_min` passes it.

    Raises:
        ShapeError, ArgumentError, DeviceError, OutOfMemoryError: naming the argument at fault.
    """
    if rays.device.type != "cpu":
        raise DeviceError(f"rays: expected a tensor on cpu, got {rays.device}; points are listed on the CPU")
    samples = Samples(grid, march, rays)
    count = native.function(native.library("cpu"), "texgs_grid_count")(samples.handle)
    points, lengths = rays.new_empty(count, 3), torch.empty(len(rays), dtype=torch.int32)
    structures = grid.structure(), march.structure(rays)
    native.call("texgs_grid_points", samples.handle, *structures, points, lengths, device=rays.device)
    return RayPoints(points, torch.repeat_interleave(torch.arange(len(rays)), lengths))
