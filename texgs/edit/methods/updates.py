"""What methods share that edit training views again and again: how a field learns from them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

from texgs.core.errors import ArgumentError
from texgs.core.keys import key
from texgs.edit.method import Method
from texgs.edit.methods.instruction import PICTURE, SHOWN, InstructionKeys

if TYPE_CHECKING:
    from pathlib import Path

    from texgs.edit.closeness import Closeness
    from texgs.edit.dataset_update import Learner, Updated
    from texgs.edit.task import EditedScene, Task
    from texgs.edit.turns import Schedule
    from texgs.fields.field import Field
    from texgs.volume.images import Images
    from texgs.volume.view_set import View


@dataclass(frozen=True)
class UpdateKeys(InstructionKeys):
    """How a field follows views that are edited again and again."""

    frozen: bool = key(False, "geometry stays as it is, bit for bit: the paper's second comparison")
    l1: float = key(0.8, "weight of the absolute difference to edited views", least=0)
    dssim: float = key(0.2, "weight of D-SSIM", least=0)
    lpips: float = key(0.0, "weight of LPIPS on VGG-16; 0 needs no weights", least=0)

    def closeness(self, device: Any) -> Closeness:
        """The loss on views."""
        from texgs.edit.closeness import Closeness
        from texgs.models.lpips import Lpips
        from texgs.models.networks import fast_dtype

        network = Lpips.load(device=device, dtype=fast_dtype(device)) if self.lpips else None
        return Closeness(self.l1, self.dssim, self.lpips, network)

    def weights(self) -> dict[str, str]:
        """Those of the guidance, and of LPIPS where it counts."""
        return super().weights() | (dict.fromkeys(("vgg16", "lpips_vgg"), "lpips=0") if self.lpips else {})


Keys = TypeVar("Keys", bound=UpdateKeys)


def update_method(
    name: str,
    summary: str,
    settings: type[Keys],
    run: Callable[[Task[Keys]], EditedScene],
    schedule: Callable[[Keys, int], Schedule],
    field: str,
) -> Method[Keys]:
    """The specification of a method that edits training views while a kind of field learns from them.

    Args:
        name: of the method.
        summary: what it does.
        settings: its keys.
        run: see `Method`.
        schedule: from the keys and a number of views to when which are edited.
        field: kind of it.
    """

    def checked(values: Keys) -> None:
        values.check()
        if not (values.l1 or values.dssim or values.lpips):
            raise ArgumentError(
                f"edit.{name}.l1, dssim, lpips: expected a weight above 0 for one of them, got 0 for all"
            )
        schedule(values, 1)

    return Method(
        *(name, summary, settings, run, checked),
        lambda values: values.weights(),
        fields=frozenset({field}),
        follows="instruction",
        followed=lambda settings: settings.instruction,
    )


def edit_by_updates(
    task: Task[Keys],
    schedule: Callable[[Keys, int], Schedule],
    learner: Callable[[Keys, Any, Images, Closeness], Learner],
    *,
    keeps_renders: bool = False,
) -> EditedScene:
    """Give the models the look; write views.png and convergence.png.

    Args:
        task: to do.
        schedule: from its settings and a number of views to when which are edited.
        learner: from its settings, a model, its training views and the loss on views to what learns.
        keeps_renders: edits stay close to views of the fitted model, not to the training views.
    """
    from texgs.edit.dataset_update import Updated, update_field
    from texgs.edit.task import EditedScene
    from texgs.volume.images import load

    keys, guidance = task.settings, task.settings.opened(task.device)
    closeness, updates = keys.closeness(task.device), dict[str, Updated]()

    def one(name: str, model: Field, views: Sequence[View]) -> Field:
        images = load(views, task.reduce)
        updates[name] = update_field(
            *(learner(keys, model, images, closeness), images, guidance),
            task.settings_for(name).instruction,
            schedule(keys, len(views)),
            keeps_renders=keeps_renders,
            shown=SHOWN,
            seed=task.edit.seed,
            title=f"{task.title} {task.edit.name}, {name}",
        )
        return updates[name].field

    scene = task.each_model(one)
    losses = {name: {"loss": each.losses} for name, each in updates.items()}
    _write_views(task.output / "views.png", updates)
    notes: dict[str, Any] = {
        name: {"edits": each.edits, "seconds of them": each.guided} for name, each in updates.items()
    }
    notes["instruction"] = task.followed or keys.instruction
    how = f"{guidance.name}, geometry {'frozen' if keys.frozen else 'learns'}"
    return EditedScene(scene, how, PICTURE, notes=notes, losses=losses)


def noise_range(where: str, noise: Sequence[float]) -> tuple[tuple[float, float], ...]:
    """One range of noise for all rounds."""
    if len(noise) != 2 or not 0 <= noise[0] <= noise[1] <= 1:
        raise ArgumentError(f"{where}: expected two shares from 0 to 1, the smaller one first, got {noise}")
    return ((noise[0], noise[1]),)


def _write_views(path: Path, updates: dict[str, Updated]) -> None:
    """A strip of views of each model that are apart from each other, before and after."""
    from texgs.core.figures import write_grid

    rows = {}
    for name, each in updates.items():
        rows[f"{name} before"] = [old.numpy() for old, _ in each.views]
        rows[f"{name} edited"] = [new.numpy() for _, new in each.views]
    write_grid(path, rows, [f"view {index + 1}" for index in range(len(each.views))])
