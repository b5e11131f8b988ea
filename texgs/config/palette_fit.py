"""Settings of the fit of a palette field."""

from dataclasses import dataclass, field

from texgs.config.voxel_fit import GridStage, VoxelKeys
from texgs.core.errors import ArgumentError
from texgs.core.keys import key


def _voxels() -> VoxelKeys:
    return VoxelKeys(stages=[GridStage(64, 60), GridStage(128, 150), GridStage(256, 100)], degree=0)


@dataclass
class HashKeys:
    """Lattices of the hash grids, over the box around the object."""

    levels: int = key(12, "lattices", least=2, most=32)
    entries: int = key(1 << 16, "most rows of a level, a power of two", least=8, most=1 << 24)
    coarsest: int = key(16, "of the first", "cells along each side", least=1)
    finest: int = key(512, "of the last", "cells along each side", least=1, most=(1 << 20) - 1)


@dataclass
class PaletteKeys:
    """How networks are fitted. The defaults are meant for two cores of a CPU and some minutes."""

    voxels: VoxelKeys = field(
        default_factory=_voxels, metadata={"help": "fit of a grid that says where anything is, before"}
    )
    hash: HashKeys = key(HashKeys, "hash grids")
    seed_steps: int = key(200, "in which density learns that of the grid", least=0)
    base_steps: int = key(2000, "of density and base colour", least=0)
    palette_steps: int = key(500, "of palette colours and light after that", least=0)
    step: float = key(1.0, "between points on rays", "voxels", least=0.1, most=8)
    rays: int = key(4096, "a step", least=1)
    colors: int = key(1, "of the palette: basic transfer functions that the views show", least=1, most=16)
    rate: float = key(1e-2, "of Adam", above=0)
    last_rate: float = key(0.1, "at the end of the base, relative to that", above=0, most=1)
    offset_weight: float = key(0.1, "of squared offsets of palette colours", least=0)
    palette_weight: float = key(1e-3, "of the squared way of the palette from its start", least=0)
    weight_min: float = key(1e-3, "points with a smaller blending weight do not learn", least=0, below=1)

    @property
    def steps(self) -> int:
        """Of the grid and the networks."""
        return self.voxels.steps + self.seed_steps + self.base_steps + self.palette_steps

    def check(self) -> None:
        """Require values that fit each other.

        Raises:
            ArgumentError: naming the keys.
        """
        self.voxels.check("fit.palette.voxels")
        if self.hash.entries & (self.hash.entries - 1):
            raise ArgumentError(f"fit.palette.hash.entries: expected a power of two, got {self.hash.entries}")
        if self.hash.coarsest > self.hash.finest:
            raise ArgumentError(
                f"fit.palette.hash.finest: expected at least coarsest ({self.hash.coarsest}), got "
                f"{self.hash.finest}"
            )
