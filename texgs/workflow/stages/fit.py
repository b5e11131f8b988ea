"""Stages of fits in one phase."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from texgs.core.errors import ArgumentError
from texgs.core.keys import typed
from texgs.fitting.kinds import FitSpec, fit_specs
from texgs.workflow.inputs import is_fit_of, start_of_fit
from texgs.workflow.stage import Outcome, Stage, read
from texgs.workflow.stages.phase import PHASE, FitJob, PhaseSettings


@dataclass(kw_only=True)
class Settings(PhaseSettings):
    """What the stage reads of the configuration."""

    keys: Any = read(lambda config: getattr(config.fit, config.fit.field))  # of the kind of field


def work(settings: Settings, inputs: dict[str, Path], output: Path) -> Outcome:
    """Write model.safetensors.

    It reads `views`, the transforms_train.json; where seeds come from it also `volume`, the volume.nrrd.
    """
    kind, job = fit_specs()[settings.stage], FitJob.of(settings, inputs, output)
    if kind.settings is None:
        raise ArgumentError(f"{kind.name}: expected a kind of field that is fitted in one phase")
    keys = typed(kind.settings, settings.keys)
    fitted = kind.fit(replace(job, settings=keys))
    field, notes = fitted.field, dict(fitted.notes)
    kind.field.write(output / "model.safetensors", field)
    told = (fitted.seconds, fitted.iterations, fitted.losses)
    return job.outcome(field, *told, measured=("test", "train"), sizes=field.sizes(), notes=notes)


def stage_of(kind: FitSpec) -> Stage:
    """Return the stage of a kind of field that is fitted in one phase."""
    return Stage(
        kind.name,
        order=80,
        help=kind.summary,
        rule=PHASE,
        inputs=start_of_fit,
        work=work,
        applies=is_fit_of(kind.name),
        fits=kind.module,
    )


STAGES = [stage_of(kind) for kind in fit_specs().values() if kind.function]
