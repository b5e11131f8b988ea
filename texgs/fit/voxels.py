"""The fit of a sparse voxel grid to views: random rays, coarse to fine (Fridovich-Keil et al. 2022)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields

import torch
from torch import Tensor

from texgs.core.errors import FitError
from texgs.fields.voxels.rays import training_rays
from texgs.fit.kinds.voxels import GridStage, VoxelKeys
from texgs.fit.loop import require_finite
from texgs.fit.voxel_shape import hull_grid, refined, seen_voxels
from texgs.raster.voxel_grid import VoxelGrid
from texgs.raster.voxel_optimizer import VoxelOptimizer, VoxelRates, add_variation_of_some
from texgs.raster.voxels import March, Rays, Samples
from texgs.volume.images import Images

CHECKED_EVERY = 100  # steps between looks at the loss


@dataclass(frozen=True)
class VoxelProgress:
    """Where a fit is."""

    step: int  # done, from 1
    n_voxels: int
    loss: float | None  # mean squared error of the step's rays, where it was looked at


class VoxelFit:
    """A grid on one set of views.

    Args:
        images: training views with alpha, over white.
        settings: what to do.
        seed: of rays and blocks; with the same one, machine and versions results are equal.

    Raises:
        ArgumentError: if settings do not fit each other, or the views show nothing.
    """

    unit = "step"

    def __init__(self, images: Images, settings: VoxelKeys, seed: int = 0) -> None:
        settings.check()
        self.settings = settings
        self.march = March(step=settings.step, transmittance_min=settings.transmittance_min)
        self.rays = training_rays(images)
        self.generator = torch.Generator().manual_seed(seed)
        self.iteration = 0  # steps that are done
        self.seconds = 0.0  # that earlier runs have taken, kept by whoever times them
        self.losses: list[float] = []  # that were looked at
        self._begin(
            hull_grid(
                images, settings.stages[0].side, settings.half_size, settings.degree, settings.start_density
            )
        )

    def _begin(self, grid: VoxelGrid) -> None:
        """Go on with another grid; the optimiser starts anew."""
        self.grid = grid
        self.optimizer = VoxelOptimizer(grid, self.settings.optimizer)

    @property
    def iterations(self) -> int:
        """Steps of all stages."""
        return self.settings.steps

    def run(self) -> Iterator[VoxelProgress]:
        """All stages, or what is left of them."""
        start = 0
        for index, stage in enumerate(self.settings.stages):
            if index and self.iteration == start:
                self.refine()
            start += stage.steps
            while self.iteration < start:
                yield self.step(stage)
        self.grid.refresh_occupancy()

    def refine(self) -> None:
        """Remove what no ray sees, and halve the spacing."""
        s = self.settings
        self.grid.refresh_occupancy()
        kept = seen_voxels(self.grid, self.rays, self.march, s.prune_weight, s.prune_share)
        if not kept.any():
            raise FitError("voxels: expected some that show in the views, found none; lower prune_weight")
        self._begin(refined(self.grid, kept))

    def state(self) -> dict[str, Tensor]:
        """Everything a resumed run needs, as tensors, between two steps."""
        grid = {
            f"grid.{name}": torch.as_tensor(value, dtype=None if isinstance(value, Tensor) else torch.float64)
            for name, value in vars(self.grid).items()
        }
        moments = {"second": self.optimizer.second, "first": self.optimizer.first}
        kept = {f"optimizer.{name}": x for name, x in moments.items() if x is not None}
        clock = {"iteration": torch.tensor(self.iteration), "seconds": torch.tensor(self.seconds).double()}
        told = {"losses": torch.tensor(self.losses).double(), "random": self.generator.get_state()}
        return {**grid, **kept, **clock, **told}

    def restore(self, state: Mapping[str, Tensor]) -> None:
        """Go on from what `state` returned, as if the run had never stopped."""
        tensors = {f.name: state[f"grid.{f.name}"].clone() for f in fields(VoxelGrid)}
        lower, spacing = tensors.pop("lower").tolist(), tensors.pop("spacing").item()
        self._begin(VoxelGrid(tuple(lower), spacing, **tensors))
        self.optimizer.second.copy_(state["optimizer.second"])
        if self.optimizer.first is not None:
            self.optimizer.first.copy_(state["optimizer.first"])
        self.iteration = int(state["iteration"])
        self.seconds = float(state["seconds"])
        self.losses = state["losses"].tolist()
        self.generator.set_state(state["random"])

    @torch.no_grad()
    def step(self, stage: GridStage) -> VoxelProgress:
        """Rays, their mean squared error, a step of the optimiser."""
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
        is_looked_at = self.iteration % CHECKED_EVERY == 0 or self.iteration == s.steps
        loss = error.square().mean() if is_looked_at else None
        if loss is not None:
            # Densities that are not finite show nothing, so that the loss alone does not tell.
            require_finite(self.iteration, {"loss": loss, "density": self.grid.density})
            self.losses.append(float(loss))
        return VoxelProgress(self.iteration, len(self.grid), None if loss is None else float(loss))

    def psnr(self) -> float:
        """Return the PSNR in dB of the training rays that were looked at last."""
        return -10 * math.log10(max(self.losses[-1], 1e-10))

    def rates(self) -> VoxelRates:
        """Learning rates of the step to come."""
        s = self.settings
        sh = s.sh.at(self.iteration, s.steps)
        return VoxelRates(s.density.at(self.iteration, s.steps), sh, sh)
