"""DGE (Chen et al. 2024), one of the paper's baselines, on 3D Gaussians: some views are edited together."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from texgs.core.errors import ArgumentError
from texgs.core.keys import key
from texgs.edit.methods.igs2gs import rates
from texgs.edit.methods.updates import UpdateKeys, edit_by_updates, update_method
from texgs.fit.settings import CommonRates

if TYPE_CHECKING:
    from texgs.edit.closeness import Closeness
    from texgs.edit.gaussian_learner import GaussianLearner
    from texgs.edit.task import EditedScene, Task
    from texgs.edit.turns import Schedule
    from texgs.fields.gaussians.model import Gaussians
    from texgs.volume.images import Images


@dataclass(frozen=True)
class DgeKeys(UpdateKeys):
    """How Gaussians follow: rounds, in each of which some views are edited together and learned from."""

    l1: float = key(10.0, "weight of the absolute difference to edited views", least=0)
    dssim: float = key(0.0, "weight of D-SSIM", least=0)
    lpips: float = key(10.0, "weight of LPIPS on VGG-16; 0 needs no weights", least=0)
    rounds: int = key(3, "of edits", least=1)
    every: int = key(500, "iterations of a round", least=1)
    views: int = key(20, "edited in a round, drawn at random", least=1)
    noise: list[float] = key(
        [0.998, 0.3, 0.3, 0.021], "levels of the rounds' edits, as shares; later rounds have the last"
    )
    prune: bool = key(True, "Gaussians that are faint or large are removed, if geometry learns")
    rates: CommonRates = field(
        default_factory=lambda: rates(0.0125, 0.1), metadata={"help": "learning rates"}
    )


def run(task: Task[DgeKeys]) -> EditedScene:
    """Give the models the look; write views.png and convergence.png."""
    return edit_by_updates(task, schedule, learner, keeps_renders=True)


def schedule(keys: DgeKeys, views: int) -> Schedule:
    """Some views together in each round, and nothing but them."""
    from texgs.edit.turns import Schedule

    if not keys.noise or not all(0 <= level <= 1 for level in keys.noise):
        raise ArgumentError(f"edit.dge.noise: expected shares from 0 to 1, at least one, got {keys.noise}")
    levels = tuple((level, level) for level in keys.noise)
    return Schedule(keys.rounds, keys.every, keys.views, keys.views, "random", "round", levels)


def learner(keys: DgeKeys, model: Gaussians, images: Images, closeness: Closeness) -> GaussianLearner:
    """The Gaussians, by whole views."""
    from texgs.edit.gaussian_learner import GaussianLearner

    iterations = schedule(keys, len(images)).iterations
    return GaussianLearner(
        model, images, keys.rates, closeness, iterations, is_frozen=keys.frozen, prunes=keys.prune
    )


METHOD = update_method(
    "dge",
    "edit some views of a scene of 3D Gaussians together by an instruction, as DGE does",
    DgeKeys,
    run,
    schedule,
    "gaussians",
)
