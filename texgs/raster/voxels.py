"""Rendering of a sparse voxel grid along rays, differentiable in its rows."""

from __future__ import annotations

import ctypes
import weakref
from dataclasses import dataclass
from typing import Any, NamedTuple

import torch
from torch import Tensor

from texgs.core import check
from texgs.core.camera import Camera
from texgs.raster import grid_abi, native
from texgs.raster.voxel_grid import VoxelGrid

PIECE = 16_384  # rays at a time, where memory is to be saved


@dataclass(frozen=True)
class March:
    """How rays are sampled."""

    background: tuple[float, float, float] = (1.0, 1.0, 1.0)
    step: float = 0.5  # between samples, in spacings of voxels
    transmittance_min: float = 1e-3  # a ray ends with the sample that leaves less

    def structure(self, rays: Tensor) -> grid_abi.March:
        """The march along rays [N, 6] as the library takes it."""
        return grid_abi.March(
            len(rays), native.address(rays), self.background, self.step, self.transmittance_min
        )


class Rays(NamedTuple):
    """What rays bring back."""

    color: Tensor  # [N, 3] over the background
    alpha: Tensor  # [N]
    depth: Tensor  # [N] expected distance from the origin, world units; 0 where alpha is 0


class RowGradient:
    """The gradient of a grid's rows, gathered over calls until an optimiser takes it.

    A dense gradient is as large as the grid; this one is cleared where it was written, and nowhere else.
    """

    def __init__(self, grid: VoxelGrid) -> None:
        self.rows = torch.zeros_like(grid.rows)  # [n, K]
        self.touched = torch.zeros_like(grid.distance).flatten()  # blocks with a gradient


class Samples:
    """The samples of rays in the library: marched once, then gathered as often as wanted."""

    def __init__(
        self, grid: VoxelGrid, march: March, rays: Tensor, out: Rays | None = None, keep: bool = True
    ) -> None:
        self.grid, self.march, self.rays = grid, march, rays
        handle = ctypes.c_void_p()
        outputs = (None,) * 3 if out is None else out
        kept = ctypes.addressof(handle) if keep else None
        self._call("texgs_grid_render", *self._structures(), *outputs, kept)
        self.handle = handle.value
        if keep:
            weakref.finalize(self, native.library(rays.device.type).texgs_grid_release, handle.value)

    def add_gradient(self, color: Tensor | None, alpha: Tensor | None, into: RowGradient) -> None:
        """Add the gradient of rows from those of colours [N, 3] and alphas [N]."""
        structures = self._structures()
        self._call("texgs_grid_backward", self.handle, *structures, color, alpha, into.rows, into.touched)

    def mark(self, weights: Tensor) -> None:
        """Raise weights [n] of rows to the largest blending weight of a sample in a cell around the voxel."""
        self._call("texgs_grid_mark", self.handle, *self._structures(), weights)

    def _structures(self) -> tuple[grid_abi.Grid, grid_abi.March]:
        return self.grid.structure(), self.march.structure(self.rays)

    def _call(self, name: str, *arguments: object) -> None:
        grid_abi.call(name, *arguments, device=self.rays.device)


def render_rays(
    grid: VoxelGrid,
    rays: Tensor,
    march: March | None = None,
    *,
    into: RowGradient | None = None,
    keep: bool = True,
) -> Rays:
    """Blend a grid's samples along rays, front to back.

    Density and coefficients are interpolated trilinearly every `march.step`, from half a step after the ray
    enters the lattice; alpha = 1 - exp(-max(0, density) length), colour = max(0, 0.5 + Y(direction) . sh).
    Differentiable in `grid.rows`, but for depth. For a definition see `texgs.raster.reference.voxels`.

    Args:
        grid: its density and occupancy up to date, see `VoxelGrid.refresh`.
        rays: [N, 6] origin and direction of any length but zero, world units; neighbours one after the other
            are faster.
        march: how rays are sampled.
        into: where the backward pass adds its gradient, in place of `grid.rows.grad`.
        keep: the samples, 40 bytes each, for the backward pass; False: it marches piece by piece again
            (deferred back-propagation, Zhang et al. 2022), for views that memory does not suffice for.

    Raises:
        ShapeError, ArgumentError, DeviceError, OutOfMemoryError: naming the argument at fault.
    """
    check.shape("rays", rays, "N 6")
    check.floating("rays", rays)
    check.constant(rays=rays)
    check.same_device(rays=rays, rows=grid.rows)
    keep = keep and grid.rows.requires_grad and torch.is_grad_enabled()
    return Rays(*_Render.apply(grid, march or March(), rays.contiguous(), into, keep, grid.rows))


class GridView(NamedTuple):
    """What a camera sees of a grid."""

    color: Tensor  # [H, W, 3] over the background
    alpha: Tensor  # [H, W]
    depth: Tensor  # [H, W] expected depth along the camera's axis, world units; 0 where alpha is 0


def render_view(
    grid: VoxelGrid,
    camera: Camera,
    march: March | None = None,
    *,
    into: RowGradient | None = None,
    keep: bool = True,
) -> GridView:
    """Render all pixels of a camera; see `render_rays`."""
    size = (camera.height, camera.width)
    rays = camera_rays(camera).flatten(0, 1)
    color, alpha, distance = render_rays(grid, rays, march, into=into, keep=keep)
    depth = distance / rays[:, 3:].norm(dim=1)
    return GridView(color.reshape(*size, 3), alpha.reshape(size), depth.reshape(size))


def camera_rays(camera: Camera) -> Tensor:
    """Rays [H, W, 6] through the pixel centres of a camera; directions have length 1 along its axis."""
    K, R_cw = camera.K, camera.viewmat[:3, :3]
    sides = (torch.arange(side, device=K.device) for side in (camera.height, camera.width))
    y, x = torch.meshgrid(*sides, indexing="ij")
    right, down = (x + 0.5 - K[0, 2]) / K[0, 0], (y + 0.5 - K[1, 2]) / K[1, 1]
    direction = torch.stack([right, down, torch.ones_like(right)], dim=-1) @ R_cw
    return torch.cat([camera.position.expand_as(direction), direction], dim=-1)


class _Render(torch.autograd.Function):
    @staticmethod
    def forward(
        ctx: Any,
        grid: VoxelGrid,
        march: March,
        rays: Tensor,
        into: RowGradient | None,
        keep: bool,
        rows: Tensor,
    ) -> tuple[Tensor, Tensor, Tensor]:
        out = Rays(rays.new_empty(len(rays), 3), *rays.new_empty(2, len(rays)))
        samples = Samples(grid, march, rays, out, keep)
        ctx.samples = samples if keep else None
        ctx.grid, ctx.march, ctx.rays, ctx.into = grid, march, rays, into
        ctx.save_for_backward(rows)  # autograd refuses a backward pass after they were changed
        ctx.mark_non_differentiable(out.depth)
        ctx.set_materialize_grads(False)
        return out.color, out.alpha, out.depth

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, color: Tensor | None, alpha: Tensor | None, _: Any) -> tuple[Tensor | None, ...]:
        (_rows,) = ctx.saved_tensors
        into = ctx.into or RowGradient(ctx.grid)
        color = None if color is None else color.contiguous()
        alpha = None if alpha is None else alpha.contiguous()
        if ctx.samples:
            ctx.samples.add_gradient(color, alpha, into)
        else:
            for i in range(0, len(ctx.rays), PIECE):
                part = slice(i, i + PIECE)
                samples = Samples(ctx.grid, ctx.march, ctx.rays[part])
                samples.add_gradient(
                    None if color is None else color[part], None if alpha is None else alpha[part], into
                )
        return None, None, None, None, None, None if ctx.into else into.rows
