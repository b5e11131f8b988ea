"""Where the jobs of the workflow put their files, below the folder of results."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from omegaconf import DictConfig


def folder_of(rule: str, config: DictConfig, phase: str = "", tf: str | None = None) -> Path:
    """Return the folder of a job's files; `tf`: of another basic TF than `config.tf`."""
    from texgs.workflow.stage_table import RULES  # not at the top: stages import this

    return Path(config.results) / RULES[rule].folder.format(
        dataset=config.dataset.name,
        tf=tf or config.tf,
        views=config.views.name,
        fit=fit_folder(config),
        phase=phase,
        edit=edit_folder(config),
        gallery=config.gallery.name,
    )


def made(rule: str, config: DictConfig, phase: str = "", tf: str | None = None) -> Path:
    """Return the file of a job that other jobs ask for."""
    from texgs.workflow.stage_table import RULES

    return folder_of(rule, config, phase, tf) / RULES[rule].files[0]


def fit_folder(config: DictConfig) -> str:
    """Return the name of a fit's folder: the recipe, the variant of a sweep, and a seed other than 0."""
    from texgs.workflow.variants import fit_variant  # not at the top: it loads Hydra

    return _folder(config.fit.name, fit_variant(config), config.fit.seed)


def edit_folder(config: DictConfig, name: str = "") -> str:
    """Return that of an edit in the same way; `name`: of another edit than that of `config`."""
    from texgs.workflow.variants import edit_variant

    return _folder(name or config.edit.name, edit_variant(config), config.edit.seed)


def _folder(name: str, variant: str, seed: int) -> str:
    return "-".join(filter(None, (name, variant, f"s{seed}" if seed else "")))
