"""The stages of the workflow: what the modules of texgs/workflow/stages define, and the jobs of a run.

A module defines one `STAGE`, or several alike as `STAGES`; modules without either are helpers of others.
"""

import pkgutil
from collections.abc import Iterable, Iterator
from dataclasses import replace
from importlib import import_module
from string import Formatter
from typing import Any

from texgs.config.schema import Config
from texgs.core.errors import ConfigError
from texgs.core.specifications import import_specification, require_call
from texgs.workflow.inputs import is_fit
from texgs.workflow.locate import tf_names
from texgs.workflow.stage import RULES, Stage

PACKAGE = "texgs.workflow.stages"
WILDCARDS = ("dataset", "tf", "views", "fit", "phase", "edit", "gallery")  # of the folders of rules


def discovered() -> Iterator[Stage]:
    """Yield the stages that the modules define."""
    for entry in pkgutil.iter_modules(import_module(PACKAGE).__path__):
        module = import_specification(f"{PACKAGE}.{entry.name}")
        for stage in getattr(module, "STAGES", [module.STAGE] if hasattr(module, "STAGE") else []):
            require_stage(module.__name__, stage)
            yield stage


def require_stage(module: str, stage: Any) -> None:
    """Require that what a module calls STAGE is one, with a verb and a folder that jobs can have."""
    if not isinstance(stage, Stage):
        raise ConfigError(f"{module}: STAGE: expected a Stage, got {type(stage).__name__}")
    if not stage.name.isidentifier():
        raise ConfigError(f"{module}: STAGE: expected letters, digits and _ in its name, got {stage.name!r}")
    if isinstance(stage.rule.files, str):
        raise ConfigError(
            f"{module}: files of its Rule: expected names with commas, as in ('a.png',), got text"
        )
    require_call(f"{module}: work of its Stage", stage.work, "settings, inputs, output")
    for _, name, *_ in Formatter().parse(stage.rule.folder):
        if name is not None and name not in WILDCARDS:
            known = ", ".join(f"{{{each}}}" for each in WILDCARDS)
            raise ConfigError(f"{module}: folder of its Rule: expected some of {known}, got {{{name}}}")


def by_name(stages: Iterable[Stage]) -> dict[str, Stage]:
    """Return stages by name, in their order; no two have one name, nor rules one name or folder."""
    named: dict[str, Stage] = {}
    owners: dict[tuple[str, str], Stage] = {}
    for stage in sorted(stages, key=lambda stage: (stage.order, stage.name)):
        if other := named.get(stage.name):
            raise ConfigError(
                f"{other.module} and {stage.module}: expected stages of different names, got {stage.name} "
                "twice; rename yours"
            )
        for what, value in (("name", stage.rule.name), ("folder", stage.rule.folder)):
            other = owners.setdefault((what, value), stage)
            if other.rule != stage.rule:
                raise ConfigError(
                    f"stages {other.name} and {stage.name}: expected a {what} of its own for each Rule, got "
                    f"{value} twice; choose another for yours"
                )
        named[stage.name] = stage
    rules = {"all", "tables", "report", "downloads", "download", *(each.rule.name for each in named.values())}
    for stage in named.values():
        if stage.rule.target in rules:
            raise ConfigError(
                f"stage {stage.name}: target of its Rule: got {stage.rule.target}, the name of a rule; "
                "take a target that there is, such as volumes or scenes, or one of your own"
            )
    return named


STAGES: dict[str, Stage] = by_name(discovered())
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
