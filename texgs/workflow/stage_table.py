"""The stages of the workflow: what the modules of texgs/workflow/stages define, and the jobs of a run.

A module defines one `STAGE`, or several alike as `STAGES`; modules without either are helpers of others.
"""

import pkgutil
from collections.abc import Iterator
from dataclasses import replace
from importlib import import_module

from texgs.config.schema import Config
from texgs.core.specifications import imported
from texgs.workflow.inputs import is_fit
from texgs.workflow.locate import tf_names
from texgs.workflow.stage import RULES, Stage

PACKAGE = "texgs.workflow.stages"
SWEPT = ("volume", "views", "phase", "edit", "edit_metrics", "gallery")  # places shown of a sweep


def discovered() -> Iterator[Stage]:
    """Yield the stages that the modules define."""
    for entry in pkgutil.iter_modules(import_module(PACKAGE).__path__):
        module = imported(f"{PACKAGE}.{entry.name}")
        yield from getattr(module, "STAGES", [module.STAGE] if hasattr(module, "STAGE") else [])


STAGES: dict[str, Stage] = {
    stage.name: stage for stage in sorted(discovered(), key=lambda stage: (stage.order, stage.name))
}
RULES |= {stage.rule.name: stage.rule for stage in STAGES.values()}


def jobs(config: Config) -> list[tuple[Stage, Config]]:
    """Return the stages that a configuration goes through, each with its own configuration of one job."""
    names = tf_names(config)
    by_tf = [replace(config, tf=name) for name in names] if is_fit(config) else []
    return [
        (stage, each)
        for stage in STAGES.values()
        for each in filter(stage.applies, by_tf if stage.per_tf else [config])
    ]
