"""Updates of a voxel grid's rows: lazy optimisers and total variation."""

from dataclasses import dataclass

import torch
from torch import Tensor

from texgs.core import check
from texgs.core.errors import ArgumentError
from texgs.raster import native
from texgs.raster.voxel_grid import NativeGrid, VoxelGrid
from texgs.raster.voxels import RowGradient

EPSILON = 1e-8
BETAS = {"rmsprop": (0.0, 0.95), "adam": (0.9, 0.99)}  # decay of the means of gradients and of their squares
NativeRule = native.struct("texgs_rule", "f rate_density rate_base rate_sh beta1 beta2 epsilon")
native.declare("texgs_grid_total_variation", NativeGrid, "np ff pp")
native.declare("texgs_grid_step", NativeGrid, NativeRule, "pppp")


@dataclass(frozen=True)
class VoxelRates:
    """Learning rates of one step."""

    density: float
    base: float  # rate of the zeroth spherical harmonic
    sh: float  # rate of the higher ones


class VoxelOptimizer:
    """RMSProp as in Plenoxels, or Adam, on the rows with a gradient; all others stay unchanged.

    Running means start at the first gradient of a row and its square, so that the first step of each float
    is its rate, and no correction is needed. The rows of the grid change in place; its density follows them,
    its occupancy does not.
    """

    def __init__(self, grid: VoxelGrid, kind: str = "rmsprop") -> None:
        if kind not in BETAS:
            raise ArgumentError(f"optimizer: expected {' or '.join(BETAS)}, got {kind!r}")
        self.grid = grid
        self.betas = BETAS[kind]
        self.gradient = RowGradient(grid)
        self.first = torch.zeros_like(grid.rows) if kind == "adam" else None
        self.second = torch.zeros_like(grid.rows)

    def step(self, rates: VoxelRates) -> None:
        """Update the rows with a gradient, and clear it."""
        rule = NativeRule(rates.density, rates.base, rates.sh, *self.betas, EPSILON)
        state = (self.gradient.rows, self.gradient.touched, self.first, self.second)
        native.call("texgs_grid_step", self.grid.structure(), rule, *state, device=self.grid.rows.device)
        torch.autograd.graph.increment_version(self.grid.rows)  # autograd cannot see writes by the library


def add_total_variation(
    grid: VoxelGrid, blocks: Tensor, density: float, sh: float, into: RowGradient
) -> None:
    """Add the gradient of total variation over the voxels of some blocks.

    For every float of a row, weight * sqrt(1e-9 + sum over x, y, z of (next voxel - voxel)^2); a voxel
    without a row counts as equal. `blocks` [m] are places in the flattened `grid.masks`; `density` is the
    weight of the density's variation, `sh` that of the coefficients'.
    """
    into.check(grid)
    check.same_device(rows=grid.rows, blocks=blocks)
    blocks = blocks.int().contiguous()
    if len(blocks) and not 0 <= int(blocks.min()) <= int(blocks.max()) < grid.masks.numel():
        raise ArgumentError(f"blocks: expected places from 0 to {grid.masks.numel() - 1}, got others")
    weighted = (len(blocks), blocks, density, sh, into.rows, into.touched)
    native.call("texgs_grid_total_variation", grid.structure(), *weighted, device=grid.rows.device)


def add_variation_of_some(
    grid: VoxelGrid,
    density: float,
    sh: float,
    generator: torch.Generator,
    into: RowGradient,
    share: float = 0.01,  # as in Plenoxels
) -> None:
    """Add the gradient of total variation of a share of the blocks with voxels, drawn at random.

    Weights are those of a mean over voxels, on average: they do not depend on how many are drawn.
    """
    blocks = grid.masks.flatten().nonzero()[:, 0]
    if not len(blocks):
        return
    count = max(round(share * len(blocks)), 1)
    drawn = blocks[torch.randint(len(blocks), (count,), generator=generator)]
    voxels = count * len(grid) / len(blocks)
    add_total_variation(grid, drawn, density / voxels, sh / voxels, into)
