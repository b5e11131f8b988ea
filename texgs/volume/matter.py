"""What hides light inside of a volume, and which share of a light or of the sky it lets through.

Single scattering: light goes straight from a distant lamp, or from all around, to where it is seen.
"""

from collections.abc import Sequence
from math import pi, sqrt
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import grid_sample

from texgs.core.cuts import NO_CUTS, Cuts
from texgs.raster import native
from texgs.volume.caster import Caster, NativeTransfer, NativeVolume
from texgs.volume.light_cells import LightCells, NativeCells
from texgs.volume.transfer import TransferFunction

LONGEST_SIDE = 128  # cells
SKY_DIRECTIONS = 64
native.declare("texgs_extinction", NativeVolume, NativeTransfer, "ip f pi", NativeCells, "p")
native.declare("texgs_transmittance", NativeCells, "ppp")
native.declare("texgs_openness", NativeCells, "p i p f p")


class Matter:
    """What hides light: the mean extinction of cells, from functions of a volume and what cuts leave of it.

    Args:
        caster: of the volume.
        tfs: functions that are shown together.
        opacity_unit: length over which their opacities apply, world units.
        cuts: what is cut away hides nothing.
        longest: cells along the longest side.
    """

    def __init__(
        self,
        caster: Caster,
        tfs: Sequence[TransferFunction],
        opacity_unit: float,
        cuts: Cuts = NO_CUTS,
        longest: int = LONGEST_SIDE,
    ) -> None:
        (x, y, z), device = caster.half, caster.device
        self.half = (x, y, z)  # half the sides of the box, world units
        size = tuple(max(2, round(longest * half / max(self.half))) for half in self.half)
        self.extinction = torch.empty(size[::-1], device=device)  # [Z, Y, X] of the shortest edge of a cell
        self._cells = NativeCells(size, self.half)
        self._open: tuple[float, Tensor] | None = None
        half_spaces = [[*plane.normal, plane.offset] for plane in cuts.half_spaces]
        planes = torch.tensor(half_spaces).reshape(-1, 4)
        native.call(
            "texgs_extinction",
            *caster.functions(tfs),
            *(opacity_unit, planes, len(planes), self._cells, self.extinction),
            device=device,
        )

    def lit(self, to_light: Tensor | None, reach: float | None) -> LightCells:
        """Return which shares of light reach each cell.

        Args:
            to_light: [3] direction to a distant lamp; None: all of its light is there.
            reach: of matter that hides light from all around, world units; None: all of that is there.
        """
        light = self._everywhere() if reach is None else self._opened(reach).clone()
        if to_light is not None:
            self._call("texgs_transmittance", to_light.float().cpu().contiguous(), light)
        return LightCells(light, self.half)

    @property
    def edge(self) -> float:
        """Return the shortest edge of a cell, which extinctions are of; world units."""
        return min(2 * half / n for half, n in zip(self.half, self._cells.size, strict=True))

    def at(self, points: Tensor) -> Tensor:
        """Return the extinction [N] at points [N, 3] of the world, those of the box beyond it."""
        places = (points / points.new_tensor(self.half)).reshape(1, 1, 1, -1, 3)
        values = self.extinction[None, None]
        return grid_sample(values, places, padding_mode="border", align_corners=False).reshape(-1)

    def _everywhere(self) -> Tensor:
        """Return shares of 1 [Z, Y, X, 2]."""
        shape, device = (*self.extinction.shape, 2), self.extinction.device
        return torch.full(shape, 255, dtype=torch.uint8, device=device)

    def _opened(self, reach: float) -> Tensor:
        """Return the same with the openness; kept, as it does not depend on a lamp."""
        if self._open is None or self._open[0] != reach:
            light, directions = self._everywhere(), even_directions(SKY_DIRECTIONS)
            self._call("texgs_openness", len(directions), directions, reach, light)
            self._open = reach, light
        return self._open[1]

    def _call(self, name: str, *arguments: Any) -> None:
        device = self.extinction.device
        native.call(name, self._cells, self.extinction, *arguments, device=device)


def even_directions(count: int) -> Tensor:
    """Return unit vectors [n, 3], float32, evenly over the sphere: a spiral by the golden ratio."""
    heights = (np.arange(count) + 0.5) * (2 / count) - 1
    turns = np.arange(count) * (pi * (1 + sqrt(5)))
    radii = np.sqrt(1 - heights**2)
    return torch.from_numpy(np.stack([radii * np.cos(turns), radii * np.sin(turns), heights], axis=1)).float()
