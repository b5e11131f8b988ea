"""Instruct-GS2GS (Vachha and Haque 2024), one of the paper's baselines, on 3D Gaussians."""

from dataclasses import dataclass
from typing import Any

from texgs.core.keys import key
from texgs.edit.method import Method
from texgs.edit.methods.updates import UpdateKeys, noise_range, run
from texgs.edit.recipe import UpdateSchedule
from texgs.fitting.settings import CommonRates


def rates(zeroth: float, means_final: float) -> CommonRates:
    """Return the rates of 3DGS, which go on where its fits end, but for two."""
    return CommonRates(1.6e-4, 0.001, 0.005, 0.05, zeroth, zeroth / 20, means_final, 1.0)


@dataclass(frozen=True)
class Igs2gsKeys(UpdateKeys):
    """How Gaussians follow: all views are edited one after the other, then learned from for a while."""

    passes: int = key(3, "times that each view is edited", least=1)
    every: int = key(2500, "iterations from pass to pass", least=1)
    noise: list[float] = key([0.7, 0.98], "level of noise of an edit, from and to, as a share")
    rates: CommonRates = key(rates(0.0025, 0.01), "learning rates")

    def schedule(self, views: int) -> UpdateSchedule:
        """Edit all views in passes, and learn from each when it is edited."""
        levels = noise_range("edit.igs2gs.noise", self.noise)
        return UpdateSchedule(self.passes, self.every, learned="newest", levels=levels)

    def learner(self, model: Any, images: Any, loss: Any, iterations: int) -> Any:
        """Return Gaussians that learn."""
        from texgs.edit.gaussians import GaussianLearner

        return GaussianLearner(model, images, loss, iterations, self.rates, self.frozen)


METHOD = Method(
    "igs2gs",
    "edit all views of a scene of 3D Gaussians in turn by an instruction, as Instruct-GS2GS does",
    Igs2gsKeys,
    run,
    fields=frozenset({"gaussians"}),
    follows="instruction",
)
