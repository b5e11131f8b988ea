"""Sparse grids with density and view-dependent colour (Fridovich-Keil et al. 2022): scenes and files."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import ceil
from pathlib import Path
from typing import Any, ClassVar, Self

import torch
from torch import Tensor

from texgs.core import check
from texgs.core.camera import Camera
from texgs.core.errors import ShapeError, errors_at
from texgs.core.io import reading_as
from texgs.core.tensor_file import read_tensor_file, write_tensor_file
from texgs.fields.field import Asked, Role, UnlitField, UnlitScene, require_depth, sizes_in_mib
from texgs.raster import Render
from texgs.raster.voxel_grid import (
    VoxelGrid,
    interpolate_rows,
    lattice_of,
    pack_rows,
    unpack_masks,
    unpack_rows,
    voxel_grid,
)
from texgs.raster.voxels import March, render_view

PIECE = 1 << 18  # voxels to process at a time
SIDE = 8  # voxels; divisor of a lattice's sides
MAX_SIDE = 1024  # voxels along a side of a lattice
FORMAT = "texgs-voxels"
VERSION = 1
COEFFICIENTS = {1: 0, 4: 1, 9: 2}  # degrees by number of coefficients


@dataclass(frozen=True, eq=False)
class Voxels(UnlitField):
    """A sparse grid with baked light."""

    kind: ClassVar[str] = "voxels"

    grid: VoxelGrid
    march: March = field(default_factory=March)
    metadata: Mapping[str, Any] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.grid)

    @property
    def device(self) -> torch.device:
        """The device of its rows."""
        return self.grid.rows.device

    def to(self, device: torch.device | str) -> Self:
        """Return the same field on another device."""
        return replace(self, grid=self.grid.to(device))

    def tensors(self, role: Role) -> dict[str, Tensor]:
        """Return densities [n], or spherical harmonics [n, 1, 4 or 9, 3]."""
        density, sh = unpack_rows(self.grid.rows)
        return {"density": density} if role == "geometry" else {"sh": sh}

    def draw(
        self,
        camera: Camera,
        background: Tensor | None,
        outputs: Collection[str],
        depth_range: Tensor | None = None,
    ) -> Render:
        """Render the grid within the depth range [2, H, W] of each pixel."""
        require_depth(outputs, self.kind)
        red, green, blue = (1.0, 1.0, 1.0) if background is None else background.tolist()
        march = replace(self.march, background=(red, green, blue))
        view = render_view(self.grid, camera, march, depth_range=depth_range)
        return view if outputs else replace(view, depth=None)

    def sizes(self) -> dict[str, float]:
        """Return sizes in MiB.

        The paper counts an index of 32 bits for each point of the lattice, densities of 32 bits and
        coefficients of 16; the file has a mask and a number for each block of 64 points, and 32 bits a value.
        """
        grid, values = self.grid, 3 * (self.grid.degree + 1) ** 2
        x, y, z = grid.size
        colors, blocks = values * len(grid), 8 * grid.masks.numel()
        return sizes_in_mib(
            {"geometry": 4 * x * y * z + 4 * len(grid), "shading": 2 * colors, "texture": 0},
            {"geometry": blocks + 4 * len(grid), "shading": 4 * colors, "texture": 0},
        )


class VoxelScene(UnlitScene[Voxels]):
    """Several grids in one scene, see `UnlitScene`; each set of edits makes a merged grid.

    Opacity is a factor on densities.
    """

    def __init__(self, fields: Sequence[Voxels], segments: Sequence[Sequence[Tensor]] = ()) -> None:
        super().__init__(fields, segments)
        self._merged: tuple[tuple[float, ...], Voxels] | None = None

    def _blend(self, factors: Sequence[float], camera: Camera, asked: Asked) -> Render:
        key = tuple(factors)
        if self._merged is None or self._merged[0] != key:
            self._merged = (key, self._merge(key))
        return self._merged[1].draw(camera, *asked)

    def _merge(self, factors: tuple[float, ...]) -> Voxels:
        first, grids = self.fields[0], []
        for each, factor in zip(self.fields, factors, strict=True):
            if factor == 0 and any(factors):
                continue  # a hidden grid needs no voxels
            density, sh = unpack_rows(each.grid.rows)
            grids.append(each.grid.with_rows(pack_rows(density * factor, sh)))
        return replace(first, grid=grids[0] if len(grids) == 1 else merge_grids(grids))


def merge_grids(grids: Sequence[VoxelGrid]) -> VoxelGrid:
    """Merge grids into one: densities add up, colours are means weighted by density.

    It has the finest of their spacings, or a wider one that gives MAX_SIDE voxels along the longest side.
    Grids that have another lattice are interpolated at its voxels, which blurs them by less than one.
    """
    lower, upper = (torch.stack(ends) for ends in zip(*map(_bounds, grids), strict=True))  # [G, 3]
    lower, upper = lower.amin(0), upper.amax(0)
    spacing, longest = min(grid.spacing for grid in grids), float((upper - lower).max())
    if round(longest / spacing, 3) > MAX_SIDE - 1:
        spacing = longest / (MAX_SIDE - 1)
    # Extents are whole numbers of voxels but for rounding, where lattices are the same.
    extents = ((upper - lower) / spacing).tolist()
    size = [SIDE * ceil((round(extent, 3) + 1) / SIDE) for extent in extents]
    mask = torch.zeros(size, dtype=torch.bool, device=lower.device)
    for grid in grids:
        mask |= _reached(mask, (grid.points() - lower) / spacing, grid.spacing / spacing)
    degree = max(grid.degree for grid in grids)
    whole = voxel_grid(mask, lower.tolist(), spacing, degree)
    points = whole.points()
    rows = [_blended(grids, piece, degree) for piece in points.split(PIECE)]
    return whole.with_rows(torch.cat([whole.rows[:1], *rows]))


def _bounds(grid: VoxelGrid) -> tuple[Tensor, Tensor]:
    """Return the places of the first and the last voxel, [3] each."""
    lower = grid.rows.new_tensor(grid.lower)
    return lower, lower + grid.spacing * (grid.rows.new_tensor(grid.size) - 1)


def _reached(lattice: Tensor, places: Tensor, reach: float) -> Tensor:
    """Return which voxels of a lattice [X, Y, Z] lie within `reach` of places [n, 3] along each axis.

    Some that are a little farther are among them.
    """
    marked, cell = torch.zeros_like(lattice), places.floor().long()
    most = cell.new_tensor(lattice.shape) - 1
    for offset in torch.cartesian_prod(*[cell.new_tensor([0, 1])] * 3):
        x, y, z = (cell + offset).clamp_min(0).minimum(most).unbind(1)
        marked[x, y, z] = True
    for axis in range(3):
        near = marked.clone()
        for step in range(1, min(ceil(round(reach, 3)), lattice.shape[axis])):
            count = lattice.shape[axis] - step
            near.narrow(axis, step, count).logical_or_(marked.narrow(axis, 0, count))
            near.narrow(axis, 0, count).logical_or_(marked.narrow(axis, step, count))
        marked = near
    return marked


def _blended(grids: Sequence[VoxelGrid], points: Tensor, degree: int) -> Tensor:
    """Return rows [m, K] at points [m, 3].

    A negative density shows nothing at its voxel, but it thins what is interpolated between voxels. It stays
    where no grid has a positive one.
    """
    rows = [unpack_rows(interpolate_rows(grid, points)) for grid in grids]
    density = torch.stack([each for each, _ in rows])  # [G, m]
    positive = density.clamp_min(0)
    shows = positive.sum(0) > 0
    total = torch.where(shows, positive.sum(0), density.amin(0))
    weights = torch.where(shows, positive, -density.clamp_max(0))
    weights = weights / weights.sum(0).clamp_min(1e-12)
    color = points.new_zeros(len(points), (degree + 1) ** 2, 3)
    for weight, (_, sh) in zip(weights, rows, strict=True):
        color[:, : sh.shape[1]] += weight[:, None, None] * sh
    return pack_rows(total, color)


def write_voxels(path: str | Path, field: Voxels) -> Path:
    """Create or replace a file of voxels in one step; its metadata must be JSON."""
    density, sh = unpack_rows(field.grid.rows.detach())
    check.finite(density=density, sh=sh)
    tensors = {"masks": field.grid.masks, "density": density.contiguous(), "sh": sh.contiguous()}
    description = {"version": VERSION, **lattice(field.grid, field.march), "metadata": dict(field.metadata)}
    return write_tensor_file(path, FORMAT, description, tensors)


def read_voxels(path: str | Path) -> Voxels:
    """Read a file of `write_voxels` bit for bit. Nothing in it is executed."""
    description, tensors = read_tensor_file(Path(path), FORMAT, VERSION)
    with errors_at(path), reading_as("a grid and its lattice", "write it again"):
        check.finite(density=tensors["density"], sh=tensors["sh"])
        return Voxels(grid_of(tensors, description), march_of(description), dict(description["metadata"]))


def lattice(grid: VoxelGrid, march: March) -> dict[str, Any]:
    """Describe a grid's lattice, and the march of rays through it."""
    marched = {"step": march.step, "transmittance_min": march.transmittance_min}
    return {"lower": grid.lower, "spacing": grid.spacing, **marched}


def march_of(description: Mapping[str, Any]) -> March:
    """Return the march of rays through a grid, from a result of `lattice`."""
    return March(step=float(description["step"]), transmittance_min=float(description["transmittance_min"]))


def grid_of(tensors: Mapping[str, Tensor], description: Mapping[str, Any]) -> VoxelGrid:
    """Make a grid from masks, densities, coefficients and a lattice."""
    masks, density, sh = (tensors[name] for name in ("masks", "density", "sh"))
    check.shape("masks", masks, "X Y Z")
    n = check.shape("density", density, "N")["N"]
    if (count := check.shape("sh", sh, "N K 3", N=n)["K"]) not in COEFFICIENTS:
        raise ShapeError(f"sh: expected 1, 4 or 9 coefficients, [N, K, 3], got {count}")
    if masks.dtype != torch.int64 or density.dtype != torch.float32 or sh.dtype != torch.float32:
        raise ShapeError("masks, density, sh: expected int64 and float32, got other types")
    bits = unpack_masks(masks)
    if int(bits.sum()) + 1 != n:  # the first row stands for all other voxels
        raise ShapeError(f"masks: expected the bits of {n - 1} voxels, got {int(bits.sum())}")
    spacing = float(description["spacing"])
    grid = voxel_grid(lattice_of(bits), description["lower"], spacing, COEFFICIENTS[count])
    return grid.with_rows(pack_rows(density, sh))
