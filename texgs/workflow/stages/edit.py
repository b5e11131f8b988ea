"""Stages `edit_METHOD`: a method of editing gives a scene a new look, or a new part."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from texgs.core.names import SCENE
from texgs.edit.method import Method, method_of, methods
from texgs.fields.kinds import kinds
from texgs.report.results import EditResult
from texgs.workflow.edits import VIEWS, edited_scene
from texgs.workflow.stage import Outcome, Rule, Stage
from texgs.workflow.stages.settings import OfEdit

if TYPE_CHECKING:
    from texgs.edit.task import Task
    from texgs.scene.scene import Scene

CURVE_POINTS = 100  # of a curve of losses at most
CAPTION = "Before and after the edit; what can be relit, under another light too."


def work(settings: OfEdit, inputs: dict[str, Path], output: Path) -> Outcome:
    """Write scene.yaml, edit.png, what the method writes, and turntable.mp4 where the scene looks different.

    It reads `scene`, and for each model `views.MODEL`, the transforms_train.json of its views.
    """
    from texgs.core.check import torch_device
    from texgs.edit.task import Task, run_method
    from texgs.report.before_after import write_before_and_after, write_convergence
    from texgs.scene.scene_file import read_scene, write_scene

    method, title = method_of(settings.edit), f"{settings.dataset}: edit"
    device, before = torch_device(settings.fit.device), read_scene(inputs["scene"])
    lens = before.framed().lens(settings.fov_y)
    task = Task(
        method.of(settings.edit),
        settings.edit,
        before,
        {name.removeprefix(VIEWS): path for name, path in inputs.items() if name.startswith(VIEWS)},
        output,
        device,
        settings.reduce,
        lens,
        title,
        settings.followed,
    )
    start = time.monotonic()
    edited = run_method(method, task)
    seconds = time.monotonic() - start  # of all methods alike: with what they read and write
    write_scene(output / SCENE, edited.scene)
    result = EditResult(
        *(task.edit.name, method.name, edited.how, seconds, edited.lambda_s, dict(edited.notes)),
        *(method.follows, followed(task), *mean_losses(edited.losses), task.edit.compared),
        opacity_factors(before, edited.scene),
    )
    pictures = dict(edited.pictures)
    if method.is_look:
        kind = kinds()[settings.fit.field]
        write_before_and_after(before, edited.scene, kind, lens, output, device, title)
        pictures["edit.png"] = f"{CAPTION} The edit: {result.lifted}." if result.lifted else CAPTION
    if edited.losses:
        write_convergence(output / "convergence.png", edited.losses)
        pictures["convergence.png"] = "How the loss of the edit fell, term by term."
    return Outcome(result, pictures)


def opacity_factors(before: Scene, after: Scene) -> dict[str, float]:
    """Return the factors on opacities that an edit brought, by part, where there are any."""
    from texgs.scene.parts import entry_of, part_names

    pairs = {part: (entry_of(before, part).edit, entry_of(after, part).edit) for part in part_names(before)}
    factors = {part: new.opacity / old.opacity for part, (old, new) in pairs.items() if old.opacity}
    return {part: round(factor, 4) for part, factor in factors.items() if factor != 1}


def mean_losses(losses: Mapping[str, Mapping[str, Sequence[float]]]) -> tuple[int, dict[str, list[float]]]:
    """Return how many iterations there were, and mean losses over equal shares of them, by part and term."""
    import numpy as np

    curves = {f"{part}/{term}": values for part, terms in losses.items() for term, values in terms.items()}
    iterations = max(map(len, curves.values()), default=0)
    shares = max(1, min(CURVE_POINTS, iterations))
    return iterations, {
        name: [float(share.mean()) for share in np.array_split(values, min(shares, len(values)))]
        for name, values in curves.items()
        if values
    }


def followed(task: Task[Any]) -> dict[str, str]:
    """Return the picture or the words that each part follows; none where the method follows neither."""
    from texgs.edit.task import parts_of

    if not method_of(task.edit).follows:
        return {}
    parts = parts_of(task.scene, task.edit.parts)
    return {part: task.settings_for(part).followed() for part in parts}


RULE = Rule(
    "edit",
    "{dataset}/scene/{fit}/edits/{edit}",
    (SCENE, "edit.png"),
    target="edits",
    gpu=("fit",),
    shown={"edit.png": CAPTION},
    swept=True,
)


def stage_of(method: Method[Any]) -> Stage:
    """Return the stage of a method of editing."""
    return Stage(
        method.stage,
        order=150,
        help=method.summary,
        rule=RULE,
        inputs=edited_scene,
        work=work,
        applies=lambda config: config.tf is None and config.edit.method == method.name,
    )


STAGES = [stage_of(method) for method in methods().values()]
