"""What hides light inside of a volume, and which share of a light or of the sky it lets through.

Single scattering: light goes straight from a distant lamp, or from all around, to where it is seen.
"""

from collections.abc import Sequence
from math import pi, sqrt
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import grid_sample, pad

from texgs.core.camera import orbit_direction
from texgs.core.cuts import NO_CUTS, Cuts
from texgs.core.light import Light
from texgs.raster import native
from texgs.volume.caster import Caster, NativeTransfer, NativeVolume
from texgs.volume.light_cells import LightCells, NativeCells
from texgs.volume.transfer import TransferFunction

LONGEST_SIDE = 128  # cells
RIM = 1  # empty cells around a volume: matter that its sides cut off is in the light there
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
        longest: cells along the longest side of the volume; there are empty ones around it.
    """

    def __init__(
        self,
        caster: Caster,
        tfs: Sequence[TransferFunction],
        opacity_unit: float,
        cuts: Cuts = NO_CUTS,
        longest: int = LONGEST_SIDE,
    ) -> None:
        device = caster.device
        inner = [max(2, round(longest * half / max(caster.half))) for half in caster.half]
        found = torch.empty(inner[::-1], device=device)
        half_spaces = [[*plane.normal, plane.offset] for plane in cuts.half_spaces]
        planes = torch.tensor(half_spaces).reshape(-1, 4)
        arguments, kept = caster.functions(tfs)
        cells = NativeCells(tuple(inner), tuple(caster.half))
        native.call(
            "texgs_extinction",
            *(*arguments, opacity_unit, planes, len(planes), cells, found),
            device=device,
        )
        del kept  # the functions have to be there until now
        self.extinction = pad(found, (RIM,) * 6)  # [Z, Y, X] of the shortest edge of a cell
        x, y, z = (half * (n + 2 * RIM) / n for half, n in zip(caster.half, inner, strict=True))
        self.half = (x, y, z)  # half the sides of the box of all cells, world units
        self._cells = NativeCells(tuple(n + 2 * RIM for n in inner), self.half)
        self._open: tuple[float, Tensor] | None = None

    def lit(self, to_light: Tensor | None, reach: float | None) -> LightCells:
        """Return which shares of light reach each cell.

        Args:
            to_light: [3] direction to a distant lamp; None: no lamp, its share is 1 everywhere.
            reach: of matter that hides light from all around, world units; None: that share is 1 everywhere.
        """
        light = self._everywhere() if reach is None else self._opened(reach).clone()
        if to_light is not None:
            self._call("texgs_transmittance", to_light.float().cpu().contiguous(), light)
        return LightCells(light, self.half)

    def under(self, light: Light) -> LightCells:
        """Return which shares of a light reach each cell, as far as it casts shadows."""
        has_lamp = light.kind == "directional" and light.shadows > 0
        direction = orbit_direction(light.azimuth, light.polar) if has_lamp else None
        return self.lit(direction, light.reach if light.occlusion else None)

    @property
    def edge(self) -> float:
        """Return the shortest edge of a cell, which extinctions are of; world units."""
        return min(2 * half / n for half, n in zip(self.half, self._cells.size, strict=True))

    def at(self, points: Tensor) -> Tensor:
        """Return the extinction [N] at points [N, 3] of the world, 0 beyond the volume."""
        places = (points / points.new_tensor(self.half)).reshape(1, 1, 1, -1, 3)
        values = self.extinction[None, None]
        return grid_sample(values, places, padding_mode="border", align_corners=False).reshape(-1)

    def _everywhere(self) -> Tensor:
        """Return shares of 1 [Z, Y, X, 2]."""
        shape, device = (*self.extinction.shape, 2), self.extinction.device
        return torch.full(shape, 255, dtype=torch.uint8, device=device)

    def _opened(self, reach: float) -> Tensor:
        """Return the same with the openness; kept, as it does not depend on a lamp."""
        latest = self._open  # another thread may replace it
        if latest is None or latest[0] != reach:
            light, directions = self._everywhere(), even_directions(SKY_DIRECTIONS)
            self._call("texgs_openness", len(directions), directions, reach, light)
            self._open = latest = reach, light
        return latest[1]

    def _call(self, name: str, *arguments: Any) -> None:
        device = self.extinction.device
        native.call(name, self._cells, self.extinction, *arguments, device=device)


def even_directions(count: int) -> Tensor:
    """Return unit vectors [n, 3], float32, evenly over the sphere: a spiral by the golden ratio."""
    heights = (np.arange(count) + 0.5) * (2 / count) - 1
    turns = np.arange(count) * (pi * (1 + sqrt(5)))
    radii = np.sqrt(1 - heights**2)
    return torch.from_numpy(np.stack([radii * np.cos(turns), radii * np.sin(turns), heights], axis=1)).float()
