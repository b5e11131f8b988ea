"""Mistakes in the choice of a fit, told before any job runs."""

from __future__ import annotations

from typing import TYPE_CHECKING

from texgs.core.errors import ConfigError
from texgs.core.typed import typed
from texgs.fields.kinds import kinds
from texgs.fields.surfels.material import require_material
from texgs.fit.kinds import fit_specs
from texgs.workflow.stage import Stage

if TYPE_CHECKING:
    from omegaconf import DictConfig


def check_fit(config: DictConfig) -> None:
    """Require settings of the fit that fit each other, and a device that its field is fitted on.

    Raises:
        ConfigError: if it is fitted on others.
        ArgumentError: naming the key that is not as it should be.
    """
    fit, kind = config.fit, fit_specs()[config.fit.field]
    if config.device.name not in kind.devices:
        raise ConfigError(
            f"device: expected {' or '.join(sorted(kind.devices))} for fit={fit.name}, "
            f"which fits {fit.field}, got {config.device.name}; choose another device or fit"
        )
    if kind.settings is None:
        require_material(fit.first_material, fit.material_range)
    else:
        kind.check(typed(kind.settings, fit[kind.name]))


def require_fit(stage: Stage, config: DictConfig) -> None:
    """Require a fit that a stage can work on; stages before the fits work with any.

    Raises:
        ConfigError: if its field goes through other phases, has no surface, or is not fitted on the device.
        ArgumentError: if settings of the fit do not fit each other.
    """
    if "{fit}" not in stage.rule.folder:
        return
    fit, kind = config.fit, fit_specs()[config.fit.field]
    if stage.place == "phase" and stage.name not in kind.phases:
        owner = next(other.name for other in fit_specs().values() if stage.name in other.phases)
        raise ConfigError(
            f"fit.field: texgs {stage.name} fits {owner}, but fit={fit.name} has field {kind.name}; "
            f"run texgs {kind.phases[-1]} or choose another fit"
        )
    if stage.place == "mesh" and not kinds()[fit.field].depth:
        able = " or ".join(other.name for other in kinds().values() if other.depth)
        raise ConfigError(
            f"fit.field: texgs mesh expects a fit of {able}, but fit={fit.name} has field {kind.name}; "
            "choose another fit"
        )
    check_fit(config)
