"""The fit of a sparse voxel grid to views: random rays, coarse to fine (Fridovich-Keil et al. 2022)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields
from math import ceil, log10

import torch
from torch import Tensor

from texgs.core.errors import FitError
from texgs.fields.voxels import Voxels
from texgs.fitting.checkpoint import FOLDER, ResumableFit, run_to_end
from texgs.fitting.hull import hull_box, in_hull, lattice
from texgs.fitting.ray_settings import GridStage, VoxelKeys
from texgs.fitting.rays import TrainingRays, training_rays
from texgs.fitting.task import FitTask, Fitted
from texgs.raster.voxel_grid import VoxelGrid, interpolate_rows, pack_rows, voxel_grid
from texgs.raster.voxel_optimizer import VoxelOptimizer, VoxelRates, add_variation_of_some
from texgs.raster.voxels import March, Rays, Samples
from texgs.volume.images import Images

PIECE = 16_384  # rays to process at a time
SIDE = 8  # voxels; divisor of the coarsest grid's sides


class VoxelFit(ResumableFit):
    """A grid on training views with alpha, over white.

    With the same seed of rays and blocks, machine and versions results are equal.
    """

    def __init__(self, images: Images, settings: VoxelKeys, seed: int = 0) -> None:
        settings.check()
        super().__init__(settings.steps)
        self.settings = s = settings
        self.march = March(step=settings.step, transmittance_min=settings.transmittance_min)
        self.rays = training_rays(images)
        self.generator = torch.Generator().manual_seed(seed)
        self._begin(hull_grid(images, s.stages[0].side, s.half_size, s.degree, s.start_density))

    def _begin(self, grid: VoxelGrid) -> None:
        """Continue with another grid and a new optimiser."""
        self.grid = grid
        self.optimizer = VoxelOptimizer(grid, self.settings.optimizer)

    def run(self) -> Iterator[int]:
        """Run the remaining stages."""
        start = 0
        for index, stage in enumerate(self.settings.stages):
            if index and self.iteration == start:
                self.refine()
            start += stage.steps
            while self.iteration < start:
                self.step(stage)
                yield self.iteration
        self.grid.refresh_occupancy()

    def refine(self) -> None:
        """Remove invisible voxels, and halve the spacing."""
        self.grid.refresh_occupancy()
        self._begin(refine_grid(self.grid, self.seen()))

    def seen(self) -> Tensor:
        """Return the voxels [X, Y, Z] visible in the training views."""
        s = self.settings
        seen = seen_voxels(self.grid, self.rays, self.march, s.prune_weight, s.prune_share)
        if not seen.any():
            raise FitError("voxels: expected some that show in the views, found none; lower prune_weight")
        return seen

    def state(self) -> dict[str, Tensor]:
        """Return everything a resumed run needs, as tensors."""
        grid = {
            f"grid.{name}": torch.as_tensor(value, dtype=None if isinstance(value, Tensor) else torch.float64)
            for name, value in vars(self.grid).items()
        }
        moments = {"second": self.optimizer.second, "first": self.optimizer.first}
        kept = {f"optimizer.{name}": x for name, x in moments.items() if x is not None}
        return {**grid, **kept, "random": self.generator.get_state(), **super().state()}

    def restore(self, state: Mapping[str, Tensor]) -> None:
        """Continue from a result of `state`."""
        super().restore(state)
        tensors = {f.name: state[f"grid.{f.name}"].clone() for f in fields(VoxelGrid)}
        lower, spacing = tensors.pop("lower").tolist(), tensors.pop("spacing").item()
        self._begin(VoxelGrid(tuple(lower), spacing, **tensors))
        self.optimizer.second.copy_(state["optimizer.second"])
        if self.optimizer.first is not None:
            self.optimizer.first.copy_(state["optimizer.first"])
        self.generator.set_state(state["random"])

    @torch.no_grad()
    def step(self, stage: GridStage) -> None:
        """Draw rays, and take a step of the optimiser on their mean squared error."""
        s = self.settings
        if self.iteration % s.occupy_every == 0:
            self.grid.refresh_occupancy()
        rays, target = self.rays.draw(s.rays, s.run, self.generator)
        out = Rays(torch.empty_like(target), *target.new_empty(2, len(rays)))
        samples = Samples(self.grid, self.march, rays, out)
        error = out.color - target
        samples.add_gradient(error * (2 / error.numel()), None, self.optimizer.gradient)
        if stage.total_variation:
            variation = (s.tv_density, s.tv_sh, self.generator, self.optimizer.gradient, s.tv_share)
            add_variation_of_some(self.grid, *variation)
        self.optimizer.step(self.rates())
        self.iteration += 1
        if self.is_checked:
            # Densities that are not finite are invisible, so the loss does not show them.
            loss = error.square().mean()
            self.note(loss, {"loss": loss, "density": self.grid.density})

    def psnr(self) -> float:
        """Return the PSNR in dB of the latest training rays."""
        return -10 * log10(max(self.losses[-1], 1e-10))

    def rates(self) -> VoxelRates:
        """Return the learning rates of the next step."""
        s = self.settings
        sh = s.sh.at(self.iteration, s.steps)
        return VoxelRates(s.density.at(self.iteration, s.steps), sh, sh)


def fit_voxels(task: FitTask[VoxelKeys]) -> Fitted:
    """Fit a grid to random rays, coarse to fine, from the last checkpoint if any."""
    run = VoxelFit(task.images, task.settings, task.seed)
    seconds = run_to_end(run, task.output / FOLDER, task.title)
    field = Voxels(run.grid, run.march, task.metadata)
    return Fitted(field, seconds, run.iterations, run.losses, {"lattice": list(run.grid.size)})


def hull_grid(images: Images, side: int, half_size: float, degree: int, density: float) -> VoxelGrid:
    """Make a grey grid that fills the visual hull, with `side` voxels along the longest side of its box.

    It has spherical harmonics of a degree, and the same density, per world unit, in all voxels. The hull is
    searched in a cube around the origin, `half_size` being half its side.
    """
    low, high = hull_box(images, half_size)
    spacing = float((high - low).max()) / (side - 1)
    size = [SIDE * ceil((float(extent) / spacing + 1) / SIDE) for extent in high - low]
    mask = in_hull(images, lattice(size, low, spacing), spacing).reshape(size)
    grid = voxel_grid(mask, low.tolist(), spacing, degree)
    filled = pack_rows(torch.full((len(grid),), density), torch.zeros(len(grid), (degree + 1) ** 2, 3))
    return grid.with_rows(torch.cat([grid.rows[:1], filled]))


def seen_voxels(grid: VoxelGrid, rays: TrainingRays, march: March, weight: float, share: float) -> Tensor:
    """Return voxels [X, Y, Z] next to which some training rays have a sample with a weight above `weight`."""
    weights = torch.zeros(len(grid.rows))
    every = max(round(1 / share), 1)
    for start in range(0, len(rays), every * PIECE):  # runs of neighbours, spread over all views
        ids = torch.arange(start, min(start + PIECE, len(rays)))
        Samples(grid, march, rays.take(ids)[0]).mark(weights)
    return (weights > weight)[grid.links().long()]


def refine_grid(grid: VoxelGrid, kept: Tensor) -> VoxelGrid:
    """Make a grid with half the spacing, of the voxels around those to keep, [X, Y, Z] bool.

    Its rows are interpolated; every other one is an old row.
    """
    mask = kept
    for axis in range(3):
        mask = mask.repeat_interleave(2, axis)
    finer = voxel_grid(dilate(mask), grid.lower, grid.spacing / 2, grid.degree)
    finer.rows[0] = grid.rows[0]
    interpolate_rows(grid, finer.points(), out=finer.rows[1:])
    finer.refresh()
    return finer


def dilate(mask: Tensor) -> Tensor:
    """Dilate a mask [X, Y, Z] by all 26 neighbours."""
    for axis, side in enumerate(mask.shape):
        before, mask = mask, mask.clone()
        mask.narrow(axis, 0, side - 1).logical_or_(before.narrow(axis, 1, side - 1))
        mask.narrow(axis, 1, side - 1).logical_or_(before.narrow(axis, 0, side - 1))
    return mask
