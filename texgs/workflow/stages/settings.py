"""What jobs read of the configuration: what all of them have, and what several share, such as basic TFs.

The module of a stage adds its own in a dataclass `Settings`. Each field says what it reads.
"""

from __future__ import annotations

from dataclasses import dataclass

from texgs.config.recipes import Edit
from texgs.volume.basic_tfs import BasicTF
from texgs.volume.view_settings import ViewKeys
from texgs.workflow.edits import edit_keys, looks_of
from texgs.workflow.inputs import is_changed, shown_tfs, sweep_of_fit, view_settings
from texgs.workflow.stage import read
from texgs.workflow.sweep import fit_variant


@dataclass(kw_only=True)
class OfDataset:
    """A job of a data set."""

    stage: str
    dataset: str = read("dataset.name")
    stand_in: str = read("dataset.stand_in")  # what the data stand in for


@dataclass(kw_only=True)
class OfTF(OfDataset):
    """A job of one basic TF."""

    tf: str = read("tf")


@dataclass(kw_only=True)
class FitLabel:
    """Which fit this is, and what it runs on. One that variants of a sweep share is of none of them."""

    name: str = read("fit.name")
    field: str = read("fit.field")  # a kind of field
    seed: int = read("fit.seed")
    sweep: str = read(sweep_of_fit)
    variant: str = read(fit_variant)
    device: str = read("device.name")
    changed: bool = read(lambda config: is_changed(config.fit))  # from the file of its name


@dataclass(kw_only=True)
class Recipe(FitLabel):
    """The same, with what all stages of a fit read."""

    reduce: int = read("fit.reduce")


@dataclass(kw_only=True)
class EditedFit(FitLabel):
    """Which fit an edit is of, with the variant of the edit."""

    sweep: str = read("sweep.name")
    variant: str = read("variant")


@dataclass(kw_only=True)
class OfEdit(OfDataset):
    """A job of an edit; `weights` comes from the job."""

    edit: Edit = read(edit_keys)
    fit: EditedFit
    reduce: int = read("fit.reduce")
    fov_y: float = read("views.fov_y")  # degrees
    weights: dict[str, str | None]
    followed: dict[str, str] = read(looks_of)  # by model, where not as the edit says


@dataclass(kw_only=True)
class OfVolume(OfDataset):
    """A job that shows basic TFs of a volume, where there is one."""

    tf_values: str = read("dataset.tf_values")
    basic_tfs: dict[str, BasicTF] = read(shown_tfs)


@dataclass(kw_only=True)
class OfScene(OfDataset):
    """A job that compares a scene with its volume."""

    views: ViewKeys = read(view_settings)
    fit: FitLabel
