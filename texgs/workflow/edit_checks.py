"""Mistakes in the configuration of an edit, told before any job runs and any earlier result goes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from texgs.config.compose import compose
from texgs.config.project import members
from texgs.core.errors import MissingDataError
from texgs.edit.method import NO_METHOD, method_of
from texgs.fields.kinds import require
from texgs.workflow.edits import lineage
from texgs.workflow.inputs import scene_before
from texgs.workflow.looks import looks_of

if TYPE_CHECKING:
    from omegaconf import DictConfig


def require_base(words: tuple[str, ...]) -> None:
    """Require of an edit by hand that what it starts from is there, and has the parts that it changes.

    Raises:
        ConfigError, MissingDataError: naming what is not.
    """
    config = compose(words)
    if config.edit.base in members("edit") and scene_before(config).is_file():
        return  # it may have been made with other words than those of conf/edit: the parts it has count
    chain = lineage(words)
    if config.edit.base is not None and not scene_before(config).is_file():
        name, before = chain[-2]
        verb = method_of(compose(before).edit).stage
        raise MissingDataError(f"edit.base: {name} is not done yet; run texgs {verb} edit={name} first")


def check_edit(config: DictConfig) -> None:
    """Require of an edit all that can be told without its scene and without weights.

    Raises:
        ArgumentError: naming what is not as it should be.
    """
    if config.edit.method != NO_METHOD:
        method = method_of(config.edit)
        require(config.fit.field, method.needs, f"edit {config.edit.name}", method.fields)
        for look in looks_of(config).values() or [None]:
            method.check(method.of(config.edit, look))
        method.check_fit(method.of(config.edit), config.fit)
