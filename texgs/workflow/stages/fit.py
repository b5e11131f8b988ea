"""Stages of fits in one phase: a field of another kind than surfels, from the views alone."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from texgs.core.errors import ArgumentError
from texgs.core.keys import typed
from texgs.fit.kinds import FitSpec, fit_specs
from texgs.report.results import FitResult
from texgs.workflow.inputs import is_fit_of, recipe, view_set
from texgs.workflow.stage import Outcome, Stage
from texgs.workflow.stages.phase import PHASE, gpu_memory, quality, training_quality
from texgs.workflow.stages.settings import OfTF, Recipe

if TYPE_CHECKING:
    from texgs.fit.kinds import FitTask, Fitted


@dataclass
class Settings(OfTF):
    """What the stage reads of the configuration."""

    fit: Recipe
    keys: Any  # of the kind, whose dataclass its specification names


def work(settings: Settings, inputs: dict[str, Path], output: Path) -> Outcome:
    """Write model.safetensors.

    It reads `views`, the transforms_train.json.
    """
    from texgs.core.check import torch_device
    from texgs.fit import checkpoint
    from texgs.fit.kinds import FitTask
    from texgs.volume.images import load
    from texgs.volume.view_set import read_views

    kind, fit = fit_specs()[settings.stage], settings.fit
    if kind.settings is None or kind.fit is None:
        raise ArgumentError(f"{kind.name}: expected a kind of field that is fitted in one phase")
    title = f"{settings.dataset}/{settings.tf}: {kind.name}"
    device, views = torch_device(fit.device), read_views(inputs["views"].parent)
    task: FitTask[Any] = FitTask(
        typed(kind.settings, settings.keys),
        views,
        load(views.train, fit.reduce),
        output,
        device,
        fit.seed,
        title,
        {"dataset": settings.dataset, "tf": settings.tf},
    )
    fitted: Fitted = kind.fit(task)
    kind.field.write(output / "model.safetensors", fitted.field)
    result = FitResult(
        fitted.seconds,
        len(fitted.field),
        fitted.iterations,
        list(fitted.losses),
        sizes=fitted.field.sizes(),
        notes=dict(fitted.notes),
        **quality(fitted.field, views, fit.reduce, title),
        **training_quality(fitted.field, views, fit.reduce, title),
        peak_gpu_memory_mib=gpu_memory(device),
    )
    checkpoint.discard(output / checkpoint.FOLDER)
    return Outcome(result)


def stage_of(kind: FitSpec[Any]) -> Stage:
    """Return the stage of a kind of field that is fitted in one phase."""
    return Stage(
        kind.name,
        order=80,
        help=kind.summary,
        rule=PHASE,
        schema=Settings,
        select=lambda config: {**recipe()(config), "keys": getattr(config.fit, kind.name)},
        inputs=view_set,
        work=work,
        applies=is_fit_of(kind.name),
        fits=kind.module,
    )


STAGES = [stage_of(kind) for kind in fit_specs().values() if kind.fit is not None]
