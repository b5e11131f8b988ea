"""Rays through a sparse voxel grid: blended samples, differentiable in the rows, or the sample points."""

from ctypes import byref, c_int64
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import torch
from torch import Tensor

from texgs.core import check
from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError, ShapeError
from texgs.raster import native
from texgs.raster.arguments import require
from texgs.raster.types import Render
from texgs.raster.voxel_grid import NativeGrid, VoxelGrid

NativeMarch = native.struct(
    "texgs_march", "n n, p rays, 3f background, f step transmittance_min, p depth_range"
)
native.declare("texgs_grid_render", NativeGrid, NativeMarch, "pppp")
native.declare("texgs_grid_backward", "p", NativeGrid, NativeMarch, "pppp")
native.declare("texgs_grid_mark", "p", NativeGrid, NativeMarch, "p")
native.declare("texgs_grid_count", "p", result=c_int64, stream=False)
native.declare("texgs_grid_points", "p", NativeGrid, NativeMarch, "pp")
native.declare("texgs_grid_release", "p", result=None, stream=False)


@dataclass(frozen=True, eq=False)
class March:
    """How rays are sampled."""

    background: tuple[float, float, float] = (1.0, 1.0, 1.0)
    step: float = 0.5  # between samples, in spacings of voxels
    transmittance_min: float = 1e-3  # a ray ends with the sample that leaves less
    depth_range: Tensor | None = None
    """[2, N] in lengths of a ray's direction: samples count from the first on and before the second."""

    def structure(self, rays: Tensor) -> native.Struct:
        """Return the march along rays [N, 6] as a structure of the library."""
        require({"rays": (rays, "N 6"), "depth_range": (self.depth_range, "2 N")}, constant=("depth_range",))
        depth_range = None if self.depth_range is None else self.depth_range.contiguous()
        sampling = (self.background, self.step, self.transmittance_min)
        return NativeMarch(len(rays), rays, *sampling, depth_range)


class Rays(NamedTuple):
    """The blended result of rays."""

    color: Tensor  # [N, 3] over the background
    alpha: Tensor  # [N]
    distance: Tensor  # [N] expected distance from the origin, world units; 0 where alpha is 0


class RowGradient:
    """The gradient of a grid's rows, gathered over calls until an optimiser takes it.

    A dense gradient is as large as the grid; this one is cleared only where it was written.
    """

    def __init__(self, grid: VoxelGrid) -> None:
        self.rows = torch.zeros_like(grid.rows)  # [n, K]
        self.touched = torch.zeros_like(grid.distance).flatten()  # blocks with a gradient

    def check(self, grid: VoxelGrid) -> None:
        """Require a grid of the same layout, on the same device."""
        check.same_device(rows=grid.rows, into=self.rows)
        given, expected = list(self.rows.shape), list(grid.rows.shape)
        if (given, len(self.touched)) != (expected, grid.masks.numel()):
            raise ShapeError(
                f"into: expected the gradient of {expected} rows in {grid.masks.numel()} blocks, got one of "
                f"{given} in {len(self.touched)}; make a new one for each grid"
            )


class Samples:
    """The samples of rays [N, 6] in the library: marched once, then gathered as often as wanted.

    Colour, alpha and distance are written to `out`, dense. Without `keep` nothing can be gathered: a sample
    takes 36 bytes. Density and occupancy of the grid are up to date.
    """

    def __init__(
        self, grid: VoxelGrid, march: March, rays: Tensor, out: Rays | None = None, keep: bool = True
    ) -> None:
        require({"rays": (rays, "N 6"), "rows": (grid.rows, "n K")})
        self.grid, self.march, self.rays = grid, march, rays.contiguous()
        self.handle = native.Handle("texgs_grid_release", rays.device)
        kept = byref(self.handle.pointer) if keep else None
        outputs = (*self._structures(), *(out or (None,) * 3), kept)
        native.call("texgs_grid_render", *outputs, device=rays.device)

    def add_gradient(self, color: Tensor | None, alpha: Tensor | None, into: RowGradient) -> None:
        """Add the gradient of rows from those of colours [N, 3] and alphas [N]."""
        into.check(self.grid)
        require({"rays": (self.rays, "N 6"), "color": (color, "N 3"), "alpha": (alpha, "N")})
        dense = (None if x is None else x.contiguous() for x in (color, alpha))
        self.call("texgs_grid_backward", *dense, into.rows, into.touched)

    def mark(self, weights: Tensor) -> None:
        """Raise weights [n] of rows to the largest blending weight of a sample in a cell around the voxel."""
        require({"rows": (self.grid.rows, "n K"), "weights": (weights, "n")})
        if not weights.is_contiguous():
            raise ArgumentError("weights: expected a dense tensor, which is written to; got a view with gaps")
        self.call("texgs_grid_mark", weights)

    def call(self, name: str, *arguments: Tensor | None) -> None:
        """Call a function of the library on the kept samples."""
        if not self.handle.pointer:
            raise ArgumentError("samples: expected those that were kept, got none; march with keep=True")
        with self.handle.lock:
            native.call(name, self.handle.pointer, *self._structures(), *arguments, device=self.rays.device)

    def _structures(self) -> tuple[native.Struct, native.Struct]:
        """Return grid and march as structures of the library."""
        return self.grid.structure(), self.march.structure(self.rays)


def render_rays(grid: VoxelGrid, rays: Tensor, march: March | None = None) -> Rays:
    """Blend a grid's samples along rays, front to back.

    Density and coefficients are interpolated trilinearly every `march.step`, from half a step after the ray
    enters the lattice; alpha = 1 - exp(-max(0, density) length), colour = max(0, 0.5 + Y(direction) . sh).
    Differentiable in `grid.rows` after the first, but for distance. For a definition see
    `texgs.raster.reference.voxels`.

    Args:
        grid: its density and occupancy up to date, see `VoxelGrid.refresh`.
        rays: [N, 6] origin and direction, world units, directions of a length from 1e-15 to 1e15; neighbours
            one after the other are faster.
        march: how rays are sampled.
    """
    check.constant(rays=rays)
    keep = grid.rows.requires_grad and torch.is_grad_enabled()
    return Rays(*_Render.apply(grid, march or March(), rays.contiguous(), keep, grid.rows))


def render_view(
    grid: VoxelGrid,
    camera: Camera,
    march: March | None = None,
    *,
    depth_range: Tensor | None = None,  # [2, H, W] camera z
) -> Render:
    """Render all pixels of a camera, with depth; differentiable in the grid's rows, see `render_rays`."""
    size = (camera.height, camera.width)
    rays = camera_rays(camera).flatten(0, 1)
    if depth_range is not None:
        check.shape("depth_range", depth_range, f"2 {camera.height} {camera.width}")
        march = replace(march or March(), depth_range=depth_range.flatten(1))
    color, alpha, distance = render_rays(grid, rays, march)
    depth = distance / rays[:, 3:].norm(dim=1)
    return Render(color.reshape(*size, 3), alpha.reshape(size), depth.reshape(size))


def camera_rays(camera: Camera) -> Tensor:
    """Return rays [H, W, 6] through the pixel centres; directions have length 1 along the camera's axis."""
    direction = camera.rays()
    return torch.cat([camera.position.expand_as(direction), direction], dim=-1)


class _Render(torch.autograd.Function):
    @staticmethod
    def forward(
        ctx: Any, grid: VoxelGrid, march: March, rays: Tensor, keep: bool, rows: Tensor
    ) -> tuple[Tensor, Tensor, Tensor]:
        out = Rays(rays.new_empty(len(rays), 3), *rays.new_empty(2, len(rays)))
        ctx.samples = Samples(grid, march, rays, out, keep)
        ctx.save_for_backward(rows)  # autograd refuses a backward pass after a change in place
        ctx.mark_non_differentiable(out.distance)
        ctx.set_materialize_grads(False)
        return out.color, out.alpha, out.distance

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, color: Tensor | None, alpha: Tensor | None, _: Any) -> tuple[Tensor | None, ...]:
        (_rows,) = ctx.saved_tensors
        gradient = RowGradient(ctx.samples.grid)
        ctx.samples.add_gradient(color, alpha, gradient)
        return None, None, None, None, gradient.rows


class RayPoints(NamedTuple):
    """Points of several rays, ray by ray and front to back."""

    points: Tensor  # [m, 3] world
    ray: Tensor  # [m] int64: index of the ray


def ray_points(grid: VoxelGrid, rays: Tensor, march: March) -> RayPoints:
    """Return the samples of rays [N, 6] that `render_rays` would blend, for fields of networks; on the CPU.

    They lie `march.step` spacings apart where the grid's density is above 0, and end where less light than
    `march.transmittance_min` passes it.
    """
    require({"rays": (rays, "N 6")}, cpu="points are listed on the CPU")
    samples = Samples(grid, march, rays)
    count = native.function(native.library("cpu"), "texgs_grid_count")(samples.handle.pointer)
    points, lengths = rays.new_empty(count, 3), torch.empty(len(rays), dtype=torch.int32)
    samples.call("texgs_grid_points", points, lengths)
    return RayPoints(points, torch.repeat_interleave(torch.arange(len(rays)), lengths))
