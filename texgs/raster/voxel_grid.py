"""A sparse grid of voxels with density and spherical harmonics: its layout in memory and its rows."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf, isfinite
from typing import Any, Self

import torch
from torch import Tensor
from torch.nn.functional import embedding_bag

from texgs.core import check
from texgs.core.errors import ArgumentError, ShapeError
from texgs.raster import native
from texgs.raster.arguments import require
from texgs.raster.shading import Y00

FLOATS = {0: 4, 1: 16, 2: 32}  # floats in a row, by degree of the spherical harmonics
DEGREES = {floats: degree for degree, floats in FLOATS.items()}
SIDES = range(8, 1025, 4)  # voxels along an axis
PIECE = 1 << 17  # points to interpolate at a time
GREY = 0.5  # colour of zero coefficients
EMPTY_ROWS = 1  # rows before the voxels' own: one for all empty voxels
NativeGrid = native.struct(
    "texgs_grid", "3i size, 3f lower, f spacing, i degree, n n, p masks first occupied distance rows density"
)
native.declare("texgs_grid_occupy", NativeGrid, "pp")


@dataclass(frozen=True, eq=False)
class VoxelGrid:
    """Sparse density and colour at the points of a lattice (Fridovich-Keil et al. 2022).

    Voxels lie in blocks of 4 x 4 x 4. A block's mask has a bit for each voxel that has a row; rows follow
    each other as their voxels do, z fastest within a block and between blocks. A row holds what `pack_rows`
    says; the first one is that of all voxels without one, with density 0. `density`, `occupied` and
    `distance` follow from masks and rows: call `refresh` after changing rows.
    """

    lower: tuple[float, float, float]  # world position of voxel (0, 0, 0)
    spacing: float  # of voxels, world units
    masks: Tensor  # [X / 4, Y / 4, Z / 4] int64
    first: Tensor  # [X / 4, Y / 4, Z / 4] int32: row of a block's first voxel
    rows: Tensor  # [n, 4, 16 or 32]; the first stands for voxels without one
    density: Tensor  # [n] as in the rows
    occupied: Tensor  # [X / 4, Y / 4, Z / 4] int64: cells with visible density, by their lowest voxel
    distance: Tensor  # [X / 4, Y / 4, Z / 4] uint8: blocks to the next such cell

    @property
    def size(self) -> tuple[int, int, int]:
        """Number of voxels along x, y and z, including empty ones."""
        x, y, z = (4 * side for side in self.masks.shape)
        return x, y, z

    @property
    def degree(self) -> int:
        """Degree of the spherical harmonics, 0 to 2."""
        return DEGREES[self.rows.shape[1]]

    def __len__(self) -> int:
        """Return the number of voxels with a row."""
        return len(self.rows) - EMPTY_ROWS

    def structure(self) -> native.Struct:
        """Return the grid as a structure of the library."""
        lattice = (self.size, self.lower, self.spacing, self.degree, len(self.rows))
        found = (self.masks, self.first, self.occupied, self.distance)
        return NativeGrid(*lattice, *found, self.rows, self.density)

    @torch.no_grad()
    def refresh(self) -> None:
        """Update density and occupancy from the rows."""
        self.density.copy_(self.rows[:, 3])
        self.refresh_occupancy()

    def refresh_occupancy(self) -> None:
        """Update the occupied cells from the density."""
        native.call(
            "texgs_grid_occupy", self.structure(), self.occupied, self.distance, device=self.rows.device
        )

    def with_rows(self, rows: Tensor) -> Self:
        """Return the same voxels with other rows, [n, 4, 16 or 32]."""
        require({"rows": (rows, f"{len(self.rows)} K")})
        check.same_device(masks=self.masks, rows=rows)
        if rows.shape[1] not in DEGREES:
            raise ShapeError(f"rows: expected 4, 16 or 32 floats, got {list(rows.shape)}")
        grid = replace(
            self,
            # The library reads four numbers at once: memory that begins elsewhere is copied.
            rows=rows.contiguous() if rows.data_ptr() % 16 == 0 else rows.clone(),
            density=rows.new_empty(len(rows)),
            occupied=torch.empty_like(self.occupied),
            distance=torch.empty_like(self.distance),
        )
        grid.refresh()
        return grid

    def to(self, device: torch.device | str) -> Self:
        """Return the same grid on another device."""
        tensors: dict[str, Any] = {
            name: x.to(device) for name, x in vars(self).items() if isinstance(x, Tensor)
        }
        return replace(self, **tensors)

    def links(self) -> Tensor:
        """Return [X, Y, Z] int32: the row of each voxel, 0 where it has none."""
        bits = unpack_masks(self.masks)  # [X / 4, Y / 4, Z / 4, 64]
        rows = self.first[..., None] + bits.cumsum(-1, dtype=torch.int32) - 1
        return lattice_of((rows * bits).int())

    def points(self) -> Tensor:
        """Return the world positions [n - 1, 3] of the voxels that have a row, in their order."""
        block, bit = unpack_masks(self.masks).flatten(0, 2).nonzero().unbind(1)
        _, columns, depth = self.masks.shape
        corner = torch.stack([block // (columns * depth), block // depth % columns, block % depth], dim=1)
        inside = torch.stack([bit // 16, bit // 4 % 4, bit % 4], dim=1)
        return corner.new_tensor(self.lower, dtype=torch.float32) + self.spacing * (4 * corner + inside)


def voxel_grid(mask: Tensor, lower: Sequence[float], spacing: float, degree: int = 2) -> VoxelGrid:
    """Make a grid of zero rows: no density, and grey.

    Args:
        mask: [X, Y, Z] bool, voxels that have a row; sides are multiples of 4 from 8 to 1024.
        lower: world position of voxel (0, 0, 0), 3 numbers.
        spacing: of voxels, world units.
        degree: of the spherical harmonics, 0 to 2.
    """
    check.shape("mask", mask, "X Y Z")
    if mask.dtype != torch.bool or any(side not in SIDES for side in mask.shape):
        raise ShapeError(
            f"mask: expected bool [X, Y, Z] with multiples of 4 from 8 to 1024, got {list(mask.shape)} "
            f"{str(mask.dtype).removeprefix('torch.')}; pad it with False"
        )
    if degree not in FLOATS:
        raise ArgumentError(f"degree: expected 0, 1 or 2, got {degree}")
    if not 0 < spacing < inf:
        raise ArgumentError(f"spacing: expected a length above 0, got {spacing}")
    if len(lower) != 3 or not all(map(isfinite, lower)):
        raise ArgumentError(f"lower: expected 3 finite numbers, got {list(lower)}")
    bits = _blocks(mask)  # [X / 4, Y / 4, Z / 4, 64]
    masks = (bits.long() << torch.arange(64, device=mask.device)).sum(-1)
    counts = bits.sum(-1)
    first = (counts.flatten().cumsum(0).reshape(counts.shape) - counts + EMPTY_ROWS).int()
    x, y, z = map(float, lower)
    rows = torch.zeros(int(counts.sum()) + EMPTY_ROWS, FLOATS[degree], device=mask.device)
    empty = torch.zeros_like(masks)
    grid = VoxelGrid(
        (x, y, z), float(spacing), masks, first, rows, rows.new_zeros(len(rows)), empty, empty.to(torch.uint8)
    )
    grid.refresh()
    return grid


def pack_rows(density: Tensor, sh: Tensor) -> Tensor:
    """Pack densities [n] and coefficients [n, 1, 4 or 9, 3] into rows [n, 4, 16 or 32].

    A row is quadruples (red, green, blue, extra), one a coefficient. The first extra is the density; those of
    the second, third and fourth are the ninth coefficient.
    """
    n, count = sh.shape[:2]
    rows = sh.new_zeros(n, min(count, 8), 4)
    rows[:, :, :3] = sh[:, :8]
    rows[:, 0, 3] = density
    if count == 9:
        rows[:, 1:4, 3] = sh[:, 8]
    return rows.flatten(1)


def unpack_rows(rows: Tensor) -> tuple[Tensor, Tensor]:
    """Unpack rows into densities [n] and coefficients [n, 1, 4 or 9, 3]; inverts `pack_rows`."""
    quads = rows.unflatten(1, (-1, 4))  # [n, K / 4, 4]
    sh = quads[:, :, :3]
    if quads.shape[1] == 8:
        sh = torch.cat([sh, quads[:, None, 1:4, 3]], dim=1)
    return quads[:, 0, 3], sh


@torch.no_grad()
def recolor(grid: VoxelGrid, matrix: Tensor, offset: Tensor) -> VoxelGrid:
    """Return a grid whose every colour c is matrix @ c + offset, wherever neither is clamped to 0.

    Colour is 0.5 + Y00 s_0 + sum_k Y_k s_k. So the coefficients s_k become A s_k, and s_0 becomes
    A s_0 + (0.5 A 1 + b - 0.5) / Y00; ARF's own colour transfer leaves the last term as b. Voxels without a
    row change as well, so that the colours between them and others do. The background is the caller's.
    `matrix` is A, [3, 3], `offset` b, [3].
    """
    check.shape("matrix", matrix, "3 3")
    check.shape("offset", offset, "3")
    density, sh = unpack_rows(grid.rows)
    sh = sh @ matrix.T
    sh[:, 0] += (GREY * matrix.sum(1) + offset - GREY) / Y00
    return grid.with_rows(pack_rows(density, sh))


@torch.no_grad()
def drop_sh(grid: VoxelGrid) -> VoxelGrid:
    """Return a grid with the zeroth harmonic only: the same colour from all directions."""
    return grid.with_rows(grid.rows[:, :4])


def interpolate_rows(grid: VoxelGrid, points: Tensor, out: Tensor | None = None) -> Tensor:
    """Return the trilinear rows [m, K] at world points [m, 3], in `out` if it is given.

    Points outside of the lattice get the first row.
    """
    links = grid.links()
    out = points.new_empty(len(points), grid.rows.shape[1]) if out is None else out
    for rows, part in zip(out.split(PIECE), points.split(PIECE), strict=True):
        at = (part - part.new_tensor(grid.lower)) / grid.spacing
        cell = at.floor().int()
        size = cell.new_tensor(grid.size)
        corners, weights = [], []
        for offset in torch.cartesian_prod(*[cell.new_tensor([0, 1])] * 3):
            place = cell + offset  # [m, 3]
            inside = ((place >= 0) & (place < size)).all(1)
            x, y, z = place.clamp_min(0).minimum(size - 1).long().unbind(1)
            corners.append(links[x, y, z] * inside)
            weights.append((1 - (at - place).abs()).prod(1))
        index, weight = torch.stack(corners, 1), torch.stack(weights, 1)
        rows.copy_(embedding_bag(index, grid.rows.detach(), per_sample_weights=weight, mode="sum"))
    return out


def _blocks(lattice: Tensor) -> Tensor:
    """Return [X, Y, Z] as [X / 4, Y / 4, Z / 4, 64]."""
    x, y, z = (side // 4 for side in lattice.shape)
    return lattice.reshape(x, 4, y, 4, z, 4).permute(0, 2, 4, 1, 3, 5).reshape(x, y, z, 64)


def lattice_of(blocks: Tensor) -> Tensor:
    """Return [X / 4, Y / 4, Z / 4, 64] as [X, Y, Z]."""
    x, y, z = blocks.shape[:3]
    return blocks.reshape(x, y, z, 4, 4, 4).permute(0, 3, 1, 4, 2, 5).reshape(4 * x, 4 * y, 4 * z)


def unpack_masks(masks: Tensor) -> Tensor:
    """Return the bits of int64 masks [...], [..., 64] bool."""
    return (masks[..., None] >> torch.arange(64, device=masks.device) & 1).bool()
