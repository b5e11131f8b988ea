"""What edits of a whole experiment make of each basic scene: the table `looks` of its data set."""

from __future__ import annotations

from typing import TYPE_CHECKING

from texgs.core.errors import ConfigError
from texgs.edit.method import method_of
from texgs.workflow.locate import tf_names

if TYPE_CHECKING:
    from omegaconf import DictConfig

CAPTIONS = {"style": "styled", "instruction": "instructed"}  # keys of a look by what a method follows


def looks_of(config: DictConfig) -> dict[str, str]:
    """What each model of a scene follows; empty where all follow what the edit itself says."""
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
    return {name: table[name][follows] for name in names}


def captions(config: DictConfig) -> dict[str, str]:
    """`source_caption` and `target_caption` of an edit: its own, or those of all basic scenes together."""
    edit, table = config.edit, config.dataset.looks
    names = list(looks_of(config))
    if not names:
        return {name: edit[name] for name in ("source_caption", "target_caption")}
    after = CAPTIONS[method_of(edit).follows]
    return {
        "source_caption": " and ".join(table[name].caption for name in names),
        "target_caption": " and ".join(table[name][after] for name in names),
    }
