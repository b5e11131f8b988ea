"""Instruct-NeRF2NeRF (Haque et al. 2023), one of the paper's baselines, on voxel grids as in the paper."""

from dataclasses import dataclass
from typing import Any

from texgs.core.keys import key
from texgs.edit.method import Method
from texgs.edit.methods.updates import UpdateKeys, noise_range, run
from texgs.edit.recipe import UpdateSchedule


@dataclass(frozen=True)
class In2nKeys(UpdateKeys):
    """How a grid follows: one view is edited at a time, and patches of all views are learned from."""

    l1: float = key(1.0, "weight of the absolute difference to edited views", least=0)
    dssim: float = key(0.0, "weight of D-SSIM, which patches have not", least=0, most=0)
    lpips: float = key(1.0, "weight of LPIPS on VGG-16; 0 needs no weights", least=0)
    passes: float = key(3.0, "times that each view is edited", above=0)
    every: int = key(10, "iterations between edits", least=1)
    noise: list[float] = key([0.02, 0.98], "level of noise of an edit, from and to, as a share")
    patches: int = key(16, "patches that an iteration learns from", least=1)
    side: int = key(32, "side of a patch", "pixels", least=16)
    density: float = key(0.05, "learning rate of densities", least=0)
    sh: float = key(0.01, "learning rate of spherical harmonics", least=0)

    def schedule(self, views: int) -> UpdateSchedule:
        """Edit one view after the other."""
        rounds = max(1, round(self.passes * views))
        return UpdateSchedule(rounds, self.every, views=1, levels=noise_range("edit.in2n.noise", self.noise))

    def learner(self, model: Any, images: Any, loss: Any, iterations: int) -> Any:
        """Return a grid that learns."""
        from texgs.edit.voxels import VoxelLearner, VoxelRates

        rates = VoxelRates(0.0 if self.frozen else self.density, self.sh, self.sh)
        return VoxelLearner(model, loss, rates, self.patches, self.side)


METHOD = Method(
    "in2n",
    "edit views of a scene of voxels one by one by an instruction, as Instruct-NeRF2NeRF does",
    In2nKeys,
    run,
    fields=frozenset({"voxels"}),
    follows="instruction",
)
