"""Stages `edit_METHOD`: a method of editing gives a scene a new look, or a new part."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from texgs.config.edit import Edit
from texgs.core.device import torch_device
from texgs.edit.method import method_of
from texgs.edit.parts import parts_of
from texgs.edit.task import Task
from texgs.fields.kinds import kinds
from texgs.report.before_after import write_before_and_after
from texgs.report.convergence import write_convergence
from texgs.report.results import EditResult
from texgs.scene.scene_file import read_scene, write_scene
from texgs.workflow.stages.outcome import Outcome
from texgs.workflow.stages.settings import Distance, FitLabel, OfDataset

FALLEN = "How the loss of the edit fell, term by term."
POINTS = 100  # of a curve of losses at most
SHOWN = "Before and after the edit; what can be relit, under another light too."
VIEWS = "views."  # before the name of a model, in the names of inputs


@dataclass
class Settings(OfDataset):
    """What the stage reads of the configuration."""

    edit: Edit
    fit: FitLabel
    reduce: int
    lens: Distance
    weights: dict[str, str | None]
    followed: dict[str, str]  # by model: what it follows, where that is not what the edit says


def work(settings: Settings, inputs: dict[str, Path], output: Path) -> Outcome:
    """Write scene.yaml, edit.png, what the method writes, and turntable.mp4 where the scene looks different.

    Args:
        settings: of the job.
        inputs: `scene`, and for each model `views.MODEL`, the transforms_train.json of its views.
        output: folder.
    """
    method, title = method_of(settings.edit), f"{settings.dataset}: edit"
    device, before = torch_device(settings.fit.device), read_scene(inputs["scene"])
    task = Task(
        method.of(settings.edit),
        settings.edit,
        before,
        {name.removeprefix(VIEWS): path for name, path in inputs.items() if name.startswith(VIEWS)},
        output,
        device,
        settings.reduce,
        settings.lens.lens,
        title,
        settings.followed,
    )
    start = time.monotonic()
    edited = method.run(task)
    seconds = time.monotonic() - start  # of all methods alike: with what they read and write
    write_scene(output / "scene.yaml", edited.scene)
    pictures = dict(edited.pictures)
    if method.is_look:
        kind = kinds()[settings.fit.field]
        write_before_and_after(before, edited.scene, kind, settings.lens.lens, output, device, title)
        pictures["edit.png"] = SHOWN
    if edited.losses:
        write_convergence(output / "convergence.png", edited.losses)
        pictures["convergence.png"] = FALLEN
    result = EditResult(
        *(task.edit.name, method.name, edited.how, seconds, edited.lambda_s, dict(edited.notes)),
        *(method.follows, followed(task), *fallen(edited.losses)),
    )
    return Outcome(result, pictures)


def fallen(losses: Mapping[str, Mapping[str, Sequence[float]]]) -> tuple[int, dict[str, list[float]]]:
    """The number of iterations, and the means of losses over equal shares of them, by part and term."""
    curves = {f"{part}/{term}": values for part, terms in losses.items() for term, values in terms.items()}
    iterations = max(map(len, curves.values()), default=0)
    shares = max(1, min(POINTS, iterations))
    return iterations, {
        name: [float(share.mean()) for share in np.array_split(values, min(shares, len(values)))]
        for name, values in curves.items()
        if values
    }


def followed(task: Task[Any]) -> dict[str, str]:
    """The picture or the words that each part follows; none where the method follows neither."""
    method = method_of(task.edit)
    if not method.follows:
        return {}
    parts = [part.name for part in parts_of(task.scene, task.edit.parts)]
    return {name: method.followed(task.settings_for(name.split("/")[0])) for name in parts}
