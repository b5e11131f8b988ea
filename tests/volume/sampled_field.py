"""A volume as tensors: values and gradients at any place, and which blocks may be visible."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import max_pool2d, max_pool3d, normalize, pad

from texgs.volume.grid import Grid
from texgs.volume.transfer import TransferFunction

BLOCK = 4  # cells along the edge of a block that is known to be transparent or not


@dataclass(frozen=True)
class SampledField:
    """A volume as tensors; points are in [-1, 1]^3."""

    values: Tensor  # [1, 1, Z, Y, X] float32
    half: Tensor  # [3] half the box's sides, world units
    cells: Tensor  # [3] their number along x, y, z
    tf: TransferFunction
    visible: Tensor  # [z, y, x] bool: blocks with something to see in them or next to them

    @staticmethod
    def of(grid: Grid, tf: TransferFunction) -> SampledField:
        """Float samples are not copied."""
        with warnings.catch_warnings():  # torch dislikes maps of files, which cannot be written
            warnings.simplefilter("ignore", UserWarning)
            values = torch.from_numpy(np.asarray(grid.values, np.float32))
        cells = torch.tensor(grid.dims) - 1
        return SampledField(values[None, None], torch.tensor(grid.aabb[1]), cells, tf, _visible(values, tf))

    @property
    def voxel(self) -> float:
        """Distance of samples along the finest axis, world units."""
        return float((2 * self.half / self.cells).min())

    def may_be_seen(self, points: Tensor) -> Tensor:
        """Whether anything within BLOCK cells of points [..., 3] may be visible."""
        block = ((points + 1) * (self.cells / (2 * BLOCK))).long()
        x, y, z = (block[..., i].clamp(0, self.visible.shape[2 - i] - 1) for i in range(3))
        return self.visible[z, y, x]

    def sample(self, points: Tensor) -> Tensor:
        """Values [...] at points [..., 3], trilinear; constant outside the box.

        Between equal values it is exactly these: a + t (b - a), where grid_sample rounds.
        """
        place = ((points + 1) * (self.cells / 2)).clamp(min=torch.zeros(3), max=self.cells.float())
        lower = torch.minimum(place.floor(), self.cells - 1.0)
        inside, (x, y, z) = place - lower, lower.long().unbind(-1)
        v = self.values[0, 0]
        corners = [v[z + dz, y + dy, x + dx] for dz in (0, 1) for dy in (0, 1) for dx in (0, 1)]
        for axis in range(3):
            corners = [
                torch.lerp(low, high, inside[..., axis])
                for low, high in zip(corners[::2], corners[1::2], strict=True)
            ]
        return corners[0]

    def normals(self, points: Tensor) -> Tensor:
        """Directions [n, 3] of the gradient at points [n, 3], world axes; 0 where it is 0."""
        offsets = torch.diag(2 / self.cells)  # [3, 3]
        around = torch.stack([points[:, None] + offsets, points[:, None] - offsets])  # [2, n, 3, 3]
        ahead, behind = self.sample(around)
        return normalize((ahead - behind) * (self.cells / self.half), dim=-1, eps=1e-30)

    def lookup(self, values: Tensor) -> tuple[Tensor, Tensor]:
        """Which of values [n] may be visible, and colour and opacity [m, 4] of those."""
        low, high = self.tf.support
        where = ((values >= low) & (values <= high)).nonzero()[:, 0]
        return where, torch.from_numpy(self.tf(values[where])).float()


def _visible(values: Tensor, tf: TransferFunction) -> Tensor:
    """Blocks [z, y, x] of values [Z, Y, X] with something to see in them or next to them, bool."""
    low, high = tf.support
    layers = []
    for z in range(0, len(values) - 1, BLOCK):
        layer = values[z : z + BLOCK + 1]  # a block of cells has the samples of both its sides
        extremes = torch.stack([layer.amax(dim=0), -layer.amin(dim=0)])[None]
        extremes = pad(extremes, [0, BLOCK, 0, BLOCK], mode="replicate")
        highest, lowest = max_pool2d(extremes, BLOCK + 1, BLOCK)[0]
        layers.append((highest >= low) & (-lowest <= high))
    return max_pool3d(torch.stack(layers).float()[None, None], 3, 1, padding=1)[0, 0] > 0
