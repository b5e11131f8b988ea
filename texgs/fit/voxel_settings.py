"""Settings of the fit of a voxel grid, and the schedule of its rates."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sin
from typing import Literal

from texgs.raster.voxel_optimizer import VoxelRates


@dataclass(frozen=True)
class Stage:
    """Part of a fit at one resolution."""

    side: int  # voxels along the longest side of the box; each stage has twice those of the one before
    steps: int
    total_variation: bool = True


@dataclass(frozen=True)
class Decay:
    """A rate that falls log-linearly over the fit, after a sine ramp that starts at a hundredth."""

    start: float
    final: float
    ramp: int = 0  # steps

    def at(self, step: int, steps: int) -> float:
        """The rate of a step, 0 to steps - 1."""
        rate = self.start * (self.final / self.start) ** (step / steps)
        if step >= self.ramp:
            return rate
        return rate * (0.01 + 0.99 * sin(0.5 * pi * step / self.ramp))


@dataclass(frozen=True)
class VoxelSettings:
    """How a grid is fitted. The defaults are meant for two cores of a CPU and a minute."""

    stages: tuple[Stage, ...] = (Stage(64, 60), Stage(128, 300), Stage(256, 800))
    degree: int = 2  # of the spherical harmonics
    half_size: float = 1.3  # half the side of the cube that is searched for the object, world units
    rays: int = 8192  # a step
    run: int = 2  # rays that are neighbours: longer runs take less time a step, and more steps
    optimizer: Literal["rmsprop", "adam"] = "rmsprop"
    density: Decay = Decay(40.0, 1.0, 50)  # rate; densities are per world unit
    sh: Decay = Decay(4e-2, 4e-3)
    tv_density: float = 1e-5  # weight of total variation, and that of the coefficients
    tv_sh: float = 2e-4
    tv_share: float = 0.01  # of all blocks, a step
    start_density: float = 0.1
    prune_weight: float = 2e-3  # voxels that no sample around has a larger blending weight than are removed
    prune_share: float = 0.1  # of the training rays that are looked at
    occupy_every: int = 50  # steps between looks at which cells show anything
    step: float = 0.5  # between samples, in voxels
    transmittance_min: float = 1e-3

    @property
    def steps(self) -> int:
        """Of all stages."""
        return sum(stage.steps for stage in self.stages)

    def rates(self, step: int) -> VoxelRates:
        """Learning rates of a step."""
        sh = self.sh.at(step, self.steps)
        return VoxelRates(self.density.at(step, self.steps), sh, sh)


QUICK = VoxelSettings()
# The full settings of Plenoxels for bounded scenes (Fridovich-Keil et al. 2022). Their rates are stated over
# 250,000 steps, of which 128,000 are run.
PLENOXELS = VoxelSettings(
    stages=(Stage(256, 38_400), Stage(512, 89_600, total_variation=False)),
    rays=5000,
    run=1,
    optimizer="rmsprop",
    tv_sh=1e-3,
    density=Decay(30.0, 30.0 * (0.05 / 30.0) ** (128 / 250), 15_000),
    sh=Decay(1e-2, 1e-2 * (5e-6 / 1e-2) ** (128 / 250)),
    prune_weight=5e-4,
    prune_share=1.0,
)
