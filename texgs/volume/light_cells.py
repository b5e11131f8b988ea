"""Which share of light reaches a place inside of a volume.

It is known at the centres of cells, and trilinear between them.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from texgs.raster import native
from texgs.raster.arguments import require

OUTSET = 2.5  # cells along its normal from which light comes to a place: matter must not darken itself
NativeCells = native.struct("texgs_cells", "3i size, 3f half")
native.declare("texgs_light_lookup", NativeCells, "p n pp")


@dataclass(frozen=True, eq=False)
class LightCells:
    """Shares of light, 0 to 1, that reach the centres of cells in the box of a volume.

    The first is that of a distant lamp, the second of light from all around, the openness: twice the mean
    over all directions, at most 1, as an even surface hides half of them by itself.
    """

    light: Tensor  # [Z, Y, X, 2] uint8, shares in 255ths
    half: tuple[float, float, float]  # half the sides of the box, world units

    @property
    def size(self) -> tuple[int, int, int]:
        """Return the numbers of cells along x, y and z."""
        z, y, x, _ = self.light.shape
        return x, y, z

    @property
    def outset(self) -> float:
        """Return how far from a place, along its normal, its light is looked up; world units."""
        return OUTSET * min(2 * half / n for half, n in zip(self.half, self.size, strict=True))

    def at(self, points: Tensor) -> Tensor:
        """Return the shares [N, 2] at points [N, 3] of the world, those of the box beyond it."""
        require({"points": (points, "N 3")})
        shares = torch.empty(len(points), 2, device=points.device)
        cells = NativeCells(self.size, self.half)
        arguments = (cells, self.light, len(points), points.contiguous(), shares)
        native.call("texgs_light_lookup", *arguments, device=points.device)
        return shares
