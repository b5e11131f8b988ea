"""Stages `edit_METHOD`: a method of editing gives a scene a new look, or a new part."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from yaml import YAMLError

from texgs.config.project import is_scene_file
from texgs.config.recipes import Edit
from texgs.core.errors import ArgumentError, ConfigError
from texgs.core.plain_yaml import parse_yaml
from texgs.edit.keys import EditKeys
from texgs.edit.method import Method, method_of, methods
from texgs.fields.kinds import kinds
from texgs.report.results import EditResult
from texgs.workflow.inputs import models_of_scene, scene_before, view_set
from texgs.workflow.locate import tf_names
from texgs.workflow.stage import Config, Outcome, Rule, Stage, read
from texgs.workflow.stages.settings import Distance, FitLabel, OfDataset

if TYPE_CHECKING:
    from texgs.edit.task import Task

CAPTIONS = {"style": "styled", "instruction": "instructed"}  # keys of a look by what a method follows
POINTS = 100  # of a curve of losses at most
SHOWN = "Before and after the edit; what can be relit, under another light too."
VIEWS = "views."  # before the name of a model, in the names of inputs


def edit_keys(config: Config) -> dict[str, Any]:
    """Return what jobs of edits read of theirs: what all edits have, and the keys of the method."""
    keys = [*(field.name for field in fields(EditKeys)), config.edit.method]
    return {name: getattr(config.edit, name) for name in keys} | captions(config)


def captions(config: Config) -> dict[str, str]:
    """Return both captions of an edit: its own, or those of all basic scenes together."""
    edit, table = config.edit, config.dataset.looks
    names = list(looks_of(config))
    if not names:
        return {name: getattr(edit, name) for name in ("source_caption", "target_caption")}
    after = CAPTIONS[method_of(edit).follows]
    return {
        "source_caption": " and ".join(table[name].caption for name in names),
        "target_caption": " and ".join(getattr(table[name], after) for name in names),
    }


def looks_of(config: Config) -> dict[str, str]:
    """Return what each model of a scene follows; empty where all follow what the edit itself says."""
    edit, dataset, table = config.edit, config.dataset.name, config.dataset.looks
    if not edit.looks:
        return {}
    follows, names = method_of(edit).follows, tf_names(config)
    if not follows:
        raise ConfigError(
            f"edit.looks: expected a method that follows a picture or an instruction, got {edit.method}"
        )
    for name in names:
        if name not in table:
            raise ConfigError(
                f"dataset.looks of {dataset}: expected a look for each of {', '.join(names)}, got none for "
                f"{name}; add one, or set edit.looks=false"
            )
    return {name: getattr(table[name], follows) for name in names}


@dataclass(kw_only=True)
class EditedFit(FitLabel):
    """The same, with the variant of the edit."""

    sweep: str = read("sweep.name")
    variant: str = read("variant")


@dataclass(kw_only=True)
class Settings(OfDataset):
    """What the stage reads of the configuration; `weights` comes from the job."""

    edit: Edit = read(edit_keys)
    fit: EditedFit
    reduce: int = read("fit.reduce")
    lens: Distance
    weights: dict[str, str | None]
    followed: dict[str, str] = read(looks_of)  # by model, where not as the edit says


def work(settings: Settings, inputs: dict[str, Path], output: Path) -> Outcome:
    """Write scene.yaml, edit.png, what the method writes, and turntable.mp4 where the scene looks different.

    It reads `scene`, and for each model `views.MODEL`, the transforms_train.json of its views.
    """
    from texgs.core.check import torch_device
    from texgs.edit.task import Task
    from texgs.report.before_after import write_before_and_after, write_convergence
    from texgs.scene.scene_file import read_scene, write_scene

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
        pictures["convergence.png"] = "How the loss of the edit fell, term by term."
    result = EditResult(
        *(task.edit.name, method.name, edited.how, seconds, edited.lambda_s, dict(edited.notes)),
        *(method.follows, followed(task), *fallen(edited.losses)),
    )
    return Outcome(result, pictures)


def fallen(losses: Mapping[str, Mapping[str, Sequence[float]]]) -> tuple[int, dict[str, list[float]]]:
    """Return how many iterations there were, and mean losses over equal shares of them, by part and term."""
    import numpy as np

    curves = {f"{part}/{term}": values for part, terms in losses.items() for term, values in terms.items()}
    iterations = max(map(len, curves.values()), default=0)
    shares = max(1, min(POINTS, iterations))
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


def edited_scene(config: Config) -> dict[str, Path]:
    """Return the scene that an edit starts from, its models, their training views, and files of styles."""
    if config.edit.base == config.edit.name:
        raise ConfigError(f"edit.base: {config.edit.name} starts from itself; choose another base")
    if config.tf is not None:
        raise ConfigError(f"tf: an edit is of a scene, with all basic TFs; leave out tf={config.tf}")
    views = {f"{VIEWS}{name}": view_set(config, name)["views"] for name in tf_names(config)}
    method = method_of(config.edit)
    scene = scene_before(config)
    models = files_of_scene(scene) if is_scene_file(config.edit.base or "") else models_of_scene(config)
    looks: dict[str, str | None] = {**looks_of(config)} or {"": None}
    files = {
        f"{key}.{name}" if name else key: path
        for name, look in looks.items()
        for key, path in method.of(config.edit, look).files().items()
    }
    return {"scene": scene, **models, **views, **files}


def files_of_scene(scene: Path) -> dict[str, Path]:
    """Return the files that a scene's file names, where they are there: they decide what it shows, too."""
    try:
        named: list[object] = [parse_yaml(scene.read_text(encoding="utf-8"))]
    except (OSError, ValueError, YAMLError, ArgumentError):
        return {}  # the job tells what is wrong with it
    files: dict[str, Path] = {}
    while named:
        table = named.pop()
        for key, value in table.items() if isinstance(table, dict) else ():
            if key in ("file", "texture") and (path := scene.parent / str(value)).is_file():
                files[f"of_scene.{len(files)}"] = path
            named.append(value)
    return files


RULE = Rule(
    "edit",
    "{dataset}/scene/{fit}/edits/{edit}",
    ("scene.yaml", "edit.png"),
    target="edits",
    gpu=("fit",),
    shown={"edit.png": SHOWN},
)


def stage_of(method: Method[Any]) -> Stage:
    """Return the stage of a method of editing."""
    return Stage(
        method.stage,
        order=150,
        help=method.summary,
        rule=RULE,
        schema=Settings,
        inputs=edited_scene,
        work=work,
        applies=lambda config: config.tf is None and config.edit.method == method.name,
    )


STAGES = [stage_of(method) for method in methods().values()]
