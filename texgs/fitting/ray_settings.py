"""Settings of fits to random rays: voxel grids, and palette fields, which begin with such a grid."""

from dataclasses import dataclass
from itertools import pairwise
from math import pi, sin

from texgs.core.errors import ArgumentError
from texgs.core.keys import key


@dataclass(frozen=True)
class GridStage:
    """A stage of a fit at one resolution."""

    side: int = key(
        64, "voxels along the longest side of the box; twice those of the stage before", least=8, most=1024
    )
    steps: int = key(100, "steps at this resolution", least=1)
    total_variation: bool = key(True, "total variation is held down")


@dataclass(frozen=True)
class Decay:
    """A rate that falls log-linearly over the fit, after a sine ramp that starts at a hundredth."""

    start: float = key(1.0, "rate at the start", above=0)
    final: float = key(0.1, "rate at the end", above=0)
    ramp: int = key(0, "steps of the ramp at the start", least=0)

    def at(self, step: int, steps: int) -> float:
        """Return the rate of a step, 0 to steps - 1."""
        rate = self.start * (self.final / self.start) ** (step / steps)
        if step >= self.ramp:
            return rate
        return rate * (0.01 + 0.99 * sin(0.5 * pi * step / self.ramp))


@dataclass(frozen=True)
class VoxelKeys:
    """The fit of a grid. The defaults take about a minute on two CPU cores."""

    stages: list[GridStage] = key(
        [GridStage(64, 60), GridStage(128, 300), GridStage(256, 800)], "resolutions, one after the other"
    )
    degree: int = key(2, "degree of the spherical harmonics", least=0, most=2)
    half_size: float = key(1.3, "half the side of the cube that is searched", "world units", above=0)
    rays: int = key(8192, "rays in a step", least=1)
    run: int = key(2, "rays that are neighbours: longer runs take less time a step, and more steps", least=1)
    optimizer: str = key("rmsprop", "optimiser", choices=("rmsprop", "adam"))
    density: Decay = key(Decay(40.0, 1.0, 50), "rate of densities, per world unit")
    sh: Decay = key(Decay(4e-2, 4e-3), "rate of spherical harmonics")
    tv_density: float = key(1e-5, "weight of total variation of densities", least=0)
    tv_sh: float = key(2e-4, "weight of total variation of spherical harmonics", least=0)
    tv_share: float = key(0.01, "share of all blocks whose total variation a step looks at", above=0, most=1)
    start_density: float = key(0.1, "density of all voxels at the start, per world unit", above=0)
    prune_weight: float = key(2e-3, "voxels whose largest blending weight is below are removed", least=0)
    prune_share: float = key(0.1, "share of the training rays that pruning looks at", above=0, most=1)
    occupy_every: int = key(50, "steps between updates of which cells show anything", least=1)
    step: float = key(0.5, "distance between samples on rays", "voxels", least=0.1, most=8)
    transmittance_min: float = key(1e-3, "a ray ends where less is left", least=0, below=1)

    @property
    def steps(self) -> int:
        """Number of steps in all stages."""
        return sum(stage.steps for stage in self.stages)

    def check(self, where: str = "fit.voxels") -> None:
        """Require values that fit each other; `where` are the keys."""
        sides = [stage.side for stage in self.stages]
        if not sides or any(b != 2 * a for a, b in pairwise(sides)):
            raise ArgumentError(
                f"{where}.stages: expected sides that double from one to the next, got {sides}"
            )
        if self.run > self.rays:
            raise ArgumentError(f"{where}.run: expected at most rays ({self.rays}), got {self.run}")


@dataclass(frozen=True)
class HashKeys:
    """Lattices of the hash grids over the object's box."""

    levels: int = key(12, "number of lattices", least=2, most=32)
    entries: int = key(1 << 16, "most rows of a level, a power of two", least=8, most=1 << 24)
    coarsest: int = key(16, "size of the first lattice", "cells along each side", least=1)
    finest: int = key(512, "size of the last lattice", "cells along each side", least=1, most=(1 << 20) - 1)


@dataclass(frozen=True)
class PaletteKeys:
    """The fit of networks. The defaults take some minutes on two CPU cores."""

    voxels: VoxelKeys = key(
        VoxelKeys([GridStage(64, 60), GridStage(128, 150), GridStage(256, 100)], degree=0),
        "fit of a grid that says where anything is, made first",
    )
    hash: HashKeys = key(HashKeys, "lattices of the hash grids")
    seed_steps: int = key(200, "steps in which density learns that of the grid", least=0)
    base_steps: int = key(2000, "steps of density and base colour", least=0)
    palette_steps: int = key(500, "steps of palette colours and light after that", least=0)
    step: float = key(1.0, "distance between points on rays", "voxels", least=0.1, most=8)
    rays: int = key(4096, "rays in a step", least=1)
    colors: int = key(
        1, "palette colours: one for each basic transfer function that the views show", least=1, most=16
    )
    rate: float = key(1e-2, "rate of Adam", above=0)
    last_rate: float = key(0.1, "rate at the end of a part, relative to its start", above=0, most=1)
    offset_weight: float = key(0.1, "weight of squared offsets of palette colours", least=0)
    palette_weight: float = key(1e-3, "weight of the squared distance of the palette from its start", least=0)
    weight_min: float = key(1e-3, "points with a smaller blending weight do not learn", least=0, below=1)

    @property
    def steps(self) -> int:
        """Number of steps of the grid and the networks."""
        return self.voxels.steps + self.seed_steps + self.base_steps + self.palette_steps

    def check(self) -> None:
        """Require values that fit each other."""
        self.voxels.check("fit.palette.voxels")
        if self.hash.entries & (self.hash.entries - 1):
            raise ArgumentError(f"fit.palette.hash.entries: expected a power of two, got {self.hash.entries}")
        if self.hash.coarsest > self.hash.finest:
            raise ArgumentError(
                f"fit.palette.hash.finest: expected at least coarsest ({self.hash.coarsest}), got "
                f"{self.hash.finest}"
            )
