"""Multi-resolution hash encoding (Mueller et al. 2022): features of points, differentiable in their table.

On the CPU; deterministic for any number of threads.
"""

from dataclasses import dataclass
from functools import cached_property
from math import ceil, log2
from typing import Any

import torch
from torch import Tensor

from texgs.core.errors import ArgumentError
from texgs.raster import native
from texgs.raster.arguments import require

FEATURES = 2  # features of a point at each level
CPU = torch.device("cpu")
NativeHash = native.struct("texgs_hash", "i levels, p resolution first")
native.declare("texgs_hash_encode", NativeHash, "nppp")
native.declare("texgs_hash_backward", NativeHash, "nppp")


@dataclass(frozen=True)
class HashLevels:
    """Lattices over the unit cube whose points have rows of one table; sides grow by a constant factor.

    A level with more lattice points than `entries` has that many rows, shared by hash.
    """

    levels: int = 16
    entries: int = 1 << 19
    coarsest: int = 16  # cells along each side
    finest: int = 4096

    def __post_init__(self) -> None:
        if not 2 <= self.levels <= 32:
            raise ArgumentError(f"levels: expected 2 to 32, got {self.levels}")
        if not 8 <= self.entries <= 1 << 24 or self.entries & (self.entries - 1):
            raise ArgumentError(f"entries: expected a power of two from 8 to 2^24, got {self.entries}")
        if not 1 <= self.coarsest <= self.finest < 1 << 20:
            raise ArgumentError(
                f"coarsest, finest: expected 1 to 2^20 - 1, ascending, got {self.coarsest}, {self.finest}"
            )

    @cached_property
    def resolutions(self) -> list[int]:
        """Cells along each side, by level."""
        growth = log2(self.finest / self.coarsest) / (self.levels - 1)
        return [ceil(round(self.coarsest * 2 ** (growth * level), 6)) for level in range(self.levels)]

    @cached_property
    def first(self) -> list[int]:
        """First row of each level, and the number of rows."""
        firsts = [0]
        for resolution in self.resolutions:
            firsts.append(firsts[-1] + 8 * ceil(min((resolution + 1) ** 3, self.entries) / 8))
        return firsts

    @property
    def rows(self) -> int:
        """Number of rows of the table [rows, 2]."""
        return self.first[-1]

    @property
    def width(self) -> int:
        """Number of features of a point."""
        return FEATURES * self.levels

    def structure(self) -> native.Struct:
        """Return the levels as a structure of the library."""
        resolutions = torch.tensor(self.resolutions, dtype=torch.int32)
        return NativeHash(self.levels, resolutions, torch.tensor(self.first))


def encode(points: Tensor, table: Tensor, levels: HashLevels) -> Tensor:
    """Return the features [n, 2 levels] at points [n, 3] of the unit cube, differentiable in table [rows, 2].

    Trilinear between the lattice points of each level; points outside of the cube have the features of its
    faces. The table has all levels, one after the other. For a definition see
    `texgs.raster.reference.voxels`.
    """
    given = {"points": (points, "n 3"), "table": (table, f"{levels.rows} {FEATURES}")}
    require(given, constant=("points",), cpu="hash encoding runs on the CPU")
    return _Encode.apply(points.contiguous(), table.contiguous(), levels)


class _Encode(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, points: Tensor, table: Tensor, levels: HashLevels) -> Tensor:
        ctx.save_for_backward(points)
        ctx.levels, ctx.table = levels, table.shape
        planes = points.new_empty(levels.width, len(points))
        native.call("texgs_hash_encode", levels.structure(), len(points), points, table, planes, device=CPU)
        return planes.T  # matrix products accept this layout

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, features: Tensor) -> tuple[None, Tensor, None]:
        (points,) = ctx.saved_tensors
        gradient = points.new_empty(ctx.table)
        arguments = ctx.levels.structure(), len(points), points, features.T.contiguous(), gradient
        native.call("texgs_hash_backward", *arguments, device=CPU)
        return None, gradient, None
