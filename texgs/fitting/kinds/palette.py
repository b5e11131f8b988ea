"""The fit of a palette field: its settings, and what runs it."""

from dataclasses import dataclass

from texgs.core.errors import ArgumentError
from texgs.core.keys import key
from texgs.fields.kinds.palette import FIELD
from texgs.fitting.kinds import FitSpec, FitTask, Fitted
from texgs.fitting.kinds.voxels import GridStage, VoxelKeys


@dataclass(frozen=True)
class HashKeys:
    """Lattices of the hash grids, over the box around the object."""

    levels: int = key(12, "number of lattices", least=2, most=32)
    entries: int = key(1 << 16, "most rows of a level, a power of two", least=8, most=1 << 24)
    coarsest: int = key(16, "size of the first lattice", "cells along each side", least=1)
    finest: int = key(512, "size of the last lattice", "cells along each side", least=1, most=(1 << 20) - 1)


@dataclass(frozen=True)
class PaletteKeys:
    """How networks are fitted. The defaults are meant for two cores of a CPU and some minutes."""

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
        """Steps of the grid and the networks."""
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


def fit(task: FitTask[PaletteKeys]) -> Fitted:
    """Fit networks to random rays, from the last checkpoint if there is one."""
    from texgs.fitting.checkpoint import FOLDER, run_to_end
    from texgs.fitting.palette import PaletteFit

    run = PaletteFit(task.images, task.settings, task.seed)
    seconds = run_to_end(run, task.output / FOLDER, task.title)
    field = run.field(task.metadata)
    return Fitted(field, seconds, run.iterations, run.losses, {"palette": field.colors.tolist()})


FIT = FitSpec(
    FIELD,
    "fit networks with palette colours",
    phases=("palette",),
    settings=PaletteKeys,
    fit=fit,
    check=PaletteKeys.check,
    devices=frozenset({"cpu"}),
)
