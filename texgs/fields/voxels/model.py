"""A field of voxels with density and view-dependent colour (Plenoxels, Fridovich-Keil et al. 2022)."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.core.light import HEADLIGHT, Light
from texgs.fields.field import Role
from texgs.fields.unlit import sizes_in_mib
from texgs.raster import Render
from texgs.raster.voxel_grid import VoxelGrid, unpack_rows
from texgs.raster.voxels import March, render_view

OUTPUTS = ("depth",)


@dataclass(frozen=True, eq=False)
class Voxels:
    """A sparse grid, lit as its views were: light does not change it."""

    kind: ClassVar[str] = "voxels"

    grid: VoxelGrid
    march: March = field(default_factory=March)
    metadata: Mapping[str, Any] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.grid)

    @property
    def device(self) -> torch.device:
        """Where its rows are."""
        return self.grid.rows.device

    def to(self, device: torch.device | str) -> Voxels:
        """The same field on another device."""
        return replace(self, grid=self.grid.to(device))

    def tensors(self, role: Role) -> dict[str, Tensor]:
        """Densities [n], or spherical harmonics [n, 1, 4 or 9, 3]."""
        density, sh = unpack_rows(self.grid.rows)
        return {"density": density} if role == "geometry" else {"sh": sh}

    def render(
        self,
        camera: Camera,
        light: Light = HEADLIGHT,
        *,
        background: Tensor | None = None,
        outputs: Collection[str] = (),
    ) -> Render:
        """Render the grid.

        Args:
            camera: from where.
            light: changes nothing.
            background: [3]; white by default.
            outputs: "depth", the expected one.

        Raises:
            ArgumentError: for another output.
        """
        if unknown := sorted(set(outputs) - set(OUTPUTS)):
            raise ArgumentError(f"outputs: expected {', '.join(OUTPUTS)} of voxels, got {unknown[0]}")
        red, green, blue = (1.0, 1.0, 1.0) if background is None else background.tolist()
        view = render_view(self.grid, camera, replace(self.march, background=(red, green, blue)))
        return Render(view.color, view.alpha, depth=view.depth if outputs else None)

    def sizes(self) -> dict[str, float]:
        """Return sizes in MiB.

        The paper counts an index of 32 bits for each point of the lattice, densities of 32 bits and
        coefficients of 16; the file has a mask and a number for each block of 64 points, and 32 bits a value.
        """
        grid, values = self.grid, 3 * (self.grid.degree + 1) ** 2
        x, y, z = grid.size
        return sizes_in_mib(
            {"geometry": 4 * x * y * z + 4 * len(grid), "shading": 2 * values * len(grid), "texture": 0},
            {
                "geometry": 8 * grid.masks.numel() + 4 * len(grid),
                "shading": 4 * values * len(grid),
                "texture": 0,
            },
        )
