"""DGE (Chen et al. 2024), one of the paper's baselines, on 3D Gaussians: some views are edited together."""

from dataclasses import dataclass
from typing import Any

from texgs.core.errors import ArgumentError
from texgs.core.keys import key
from texgs.edit.method import Method
from texgs.edit.methods.igs2gs import rates
from texgs.edit.methods.updates import UpdateKeys, run
from texgs.edit.recipe import UpdateSchedule
from texgs.fitting.settings import CommonRates


@dataclass(frozen=True)
class DgeKeys(UpdateKeys):
    """How Gaussians follow: rounds, in each of which some views are edited together and learned from."""

    keeps_renders = True

    l1: float = key(10.0, "weight of the absolute difference to edited views", least=0)
    dssim: float = key(0.0, "weight of D-SSIM", least=0)
    lpips: float = key(10.0, "weight of LPIPS on VGG-16; 0 needs no weights", least=0)
    rounds: int = key(3, "rounds of edits", least=1)
    every: int = key(500, "iterations of a round", least=1)
    views: int = key(20, "views edited in a round, drawn at random", least=1)
    noise: list[float] = key(
        [0.998, 0.3, 0.3, 0.021], "levels of noise of the rounds' edits, as shares; the last one holds on"
    )
    prune: bool = key(True, "Gaussians that are faint or large are removed, if geometry learns")
    rates: CommonRates = key(rates(0.0125, 0.1), "learning rates")

    def schedule(self, views: int) -> UpdateSchedule:
        """Edit some views together in each round, and learn from nothing but them."""
        if not self.noise or not all(0 <= level <= 1 for level in self.noise):
            raise ArgumentError(f"edit.dge.noise: expected one share from 0 to 1 at least, got {self.noise}")
        levels = tuple((level, level) for level in self.noise)
        return UpdateSchedule(self.rounds, self.every, self.views, self.views, "random", "round", levels)

    def learner(self, model: Any, images: Any, loss: Any, iterations: int) -> Any:
        """Return Gaussians that learn, and may be removed."""
        from texgs.edit.gaussians import GaussianLearner

        return GaussianLearner(model, images, loss, iterations, self.rates, self.frozen, self.prune)


METHOD = Method(
    "dge",
    "edit some views of a scene of 3D Gaussians together by an instruction, as DGE does",
    DgeKeys,
    run,
    fields=frozenset({"gaussians"}),
    follows="instruction",
)
