"""Voxel grids as one scene: merged into one grid, in which densities add up."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from math import ceil

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.core.light import HEADLIGHT, Light
from texgs.fields.field import Look
from texgs.fields.part_edit import PartEdit, opacity_factors
from texgs.fields.voxels.model import Voxels
from texgs.raster import Render
from texgs.raster.voxel_grid import VoxelGrid, interpolate_rows, pack_rows, unpack_rows, voxel_grid

PIECE = 1 << 18  # voxels at a time
SIDE = 8  # voxels that sides of a lattice are multiples of


class VoxelScene:
    """Grids that are drawn together; edits of opacity and visibility make another merged grid.

    Args:
        fields: at least one, all on one device.

    Raises:
        ArgumentError: if there is none.
    """

    def __init__(self, fields: Sequence[Voxels]) -> None:
        if not fields:
            raise ArgumentError("models: expected at least one, got none")
        self.fields = list(fields)
        self._merged: tuple[tuple[float, ...], Voxels] | None = None

    def __len__(self) -> int:
        return sum(map(len, self.fields))

    @property
    def device(self) -> torch.device:
        """Where the rows are."""
        return self.fields[0].device

    @property
    def palettes(self) -> list[tuple[float, ...]]:
        """Grids have none."""
        return [(0.0, 0.0, 0.0)] * len(self.fields)

    @torch.no_grad()
    def render(
        self,
        camera: Camera,
        light: Light = HEADLIGHT,
        edits: Sequence[PartEdit] | None = None,
        *,
        look: Look = "shaded",
        background: Tensor | None = None,
        outputs: Collection[str] = (),
    ) -> Render:
        """Render all visible grids.

        Args:
            camera: from where.
            light: changes nothing.
            edits: one for each grid; opacity is a factor on densities.
            look: "shaded", as fitted.
            background: [3]; white by default.
            outputs: "depth".

        Raises:
            ArgumentError: if there are not as many edits as grids, or one cannot be shown.
        """
        if look != "shaded":
            raise ArgumentError(f"look: expected shaded of voxels, got {look}")
        factors = tuple(opacity_factors(edits, len(self.fields), Voxels.kind))
        if self._merged is None or self._merged[0] != factors:
            self._merged = (factors, self._merge(factors))
        return self._merged[1].render(camera, light, background=background, outputs=outputs)

    def _merge(self, factors: tuple[float, ...]) -> Voxels:
        first, grids = self.fields[0], []
        for field, factor in zip(self.fields, factors, strict=True):
            density, sh = unpack_rows(field.grid.rows)
            grids.append(field.grid.with_rows(pack_rows(density * factor, sh)))
        return replace(first, grid=grids[0] if len(grids) == 1 else merged(grids))


def merged(grids: Sequence[VoxelGrid]) -> VoxelGrid:
    """One grid in which densities of several add up, and colours are means weighted by them.

    It has the finest of their spacings. Grids that have another lattice are interpolated at its voxels, which
    blurs them by less than one.

    Raises:
        ShapeError: if the grids lie so far apart that a lattice around them has too many voxels.
    """
    spacing = min(grid.spacing for grid in grids)
    lower, upper = (torch.stack(ends) for ends in zip(*map(_bounds, grids), strict=True))  # [G, 3]
    lower = lower.amin(0)
    # Extents are whole numbers of voxels but for rounding, where lattices are the same.
    extents = ((upper.amax(0) - lower) / spacing).tolist()
    size = [SIDE * ceil((round(extent, 3) + 1) / SIDE) for extent in extents]
    mask = torch.zeros(size, dtype=torch.bool, device=lower.device)
    for grid in grids:
        _mark(mask, (grid.points() - lower) / spacing)
    degree = max(grid.degree for grid in grids)
    whole = voxel_grid(mask, lower.tolist(), spacing, degree)
    points = whole.points()
    rows = [_blended(grids, piece, degree) for piece in points.split(PIECE)]
    return whole.with_rows(torch.cat([whole.rows[:1], *rows]))


def _bounds(grid: VoxelGrid) -> tuple[Tensor, Tensor]:
    """Places of the first and the last voxel, [3] each."""
    lower = grid.rows.new_tensor(grid.lower)
    return lower, lower + grid.spacing * (grid.rows.new_tensor(grid.size) - 1)


def _mark(mask: Tensor, places: Tensor) -> None:
    """Set the eight voxels around places [n, 3] in a lattice."""
    cell = places.floor().long()
    most = cell.new_tensor(mask.shape) - 1
    for offset in torch.cartesian_prod(*[cell.new_tensor([0, 1])] * 3):
        x, y, z = (cell + offset).clamp_min(0).minimum(most).unbind(1)
        mask[x, y, z] = True


def _blended(grids: Sequence[VoxelGrid], points: Tensor, degree: int) -> Tensor:
    """Rows [m, K] at points [m, 3].

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
