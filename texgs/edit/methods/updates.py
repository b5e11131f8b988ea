"""What methods share that edit training views again and again: when, and how a field learns from them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from texgs.core.errors import ArgumentError
from texgs.core.keys import key
from texgs.edit.methods.instruction import SHOWN_VIEWS, InstructionKeys, write_views
from texgs.edit.recipe import UpdateSchedule

if TYPE_CHECKING:
    import numpy as np

    from texgs.edit.dataset_update import Learner
    from texgs.edit.task import EditedScene, Task
    from texgs.fields.field import Field
    from texgs.volume.view_set import View


@dataclass(frozen=True)
class UpdateKeys(InstructionKeys):
    """How a field follows views that are edited again and again."""

    keeps_renders = False  # edits stay close to views of the fitted model, and not to the training views

    frozen: bool = key(False, "geometry stays as it is, bit for bit: the paper's second comparison")
    l1: float = key(0.8, "weight of the absolute difference to edited views", least=0)
    dssim: float = key(0.2, "weight of D-SSIM", least=0)
    lpips: float = key(0.0, "weight of LPIPS on VGG-16; 0 needs no weights", least=0)

    def schedule(self, views: int) -> UpdateSchedule:
        """Return when which of so many views are edited."""
        raise NotImplementedError

    def learner(self, model: Any, images: Any, loss: Any, iterations: int) -> Learner:
        """Return a field that learns from views in so many iterations."""
        raise NotImplementedError

    def check(self) -> None:
        """Require an instruction, a loss and a schedule that there can be."""
        super().check()
        if not (self.l1 or self.dssim or self.lpips):
            raise ArgumentError(
                f"{self.node}.l1, dssim, lpips: expected a weight above 0 for one of them, got 0 for all"
            )
        self.schedule(1)

    def weights(self) -> dict[str, str]:
        """Return those of the guidance, and of LPIPS where it counts."""
        return super().weights() | (dict.fromkeys(("vgg16", "lpips_vgg"), "lpips=0") if self.lpips else {})


def run(task: Task[UpdateKeys]) -> EditedScene:
    """Give the models the look; write views.png."""
    from texgs.edit.dataset_update import PhotometricLoss, update_field
    from texgs.edit.task import EditedScene
    from texgs.models.lpips import Lpips
    from texgs.volume.images import load

    keys, guidance = task.settings, task.settings.opened(task.device)
    lpips = Lpips.load(device=task.device, dtype=None) if keys.lpips else None
    loss = PhotometricLoss(keys.l1, keys.dssim, keys.lpips, lpips)
    rows: dict[str, list[np.ndarray]] = {}
    losses: dict[str, dict[str, list[float]]] = {}
    notes: dict[str, Any] = {}

    def one(name: str, model: Field, views: Sequence[View]) -> Field:
        images, plan = load(views, task.reduce), keys.schedule(len(views))
        updated = update_field(
            keys.learner(model, images, loss, plan.iterations),
            *(images, guidance),
            task.settings_for(name).instruction,
            plan,
            keeps_renders=keys.keeps_renders,
            seed=task.edit.seed,
            title=task.title_of(name),
        )
        before, after = zip(*updated.some(SHOWN_VIEWS), strict=True)
        rows[f"{name} before"] = [old.numpy() for old in before]
        rows[f"{name} edited"] = [new.numpy() for new in after]
        notes[name] = {"edits": updated.count, "seconds of them": updated.seconds}
        losses[name] = {"loss": updated.losses}
        return updated.learner.field

    scene = task.each_model(one)
    notes["instruction"] = task.followed or keys.instruction
    how = f"{guidance.name}, geometry {'frozen' if keys.frozen else 'learns'}"
    return EditedScene(scene, how, write_views(task.output, rows), notes=notes, losses=losses)


def noise_range(where: str, noise: Sequence[float]) -> tuple[tuple[float, float], ...]:
    """Return one range of noise for all rounds."""
    if len(noise) != 2 or not 0 <= noise[0] <= noise[1] <= 1:
        raise ArgumentError(f"{where}: expected two shares from 0 to 1, the smaller one first, got {noise}")
    return ((noise[0], noise[1]),)
