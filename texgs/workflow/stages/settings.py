"""What jobs read of the configuration: what all of them have, and what several share, such as basic TFs.

The module of a stage adds its own in a dataclass `Settings`. Each field says what it reads.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from texgs.config.dataset import BasicTF
from texgs.config.recipes import Edit
from texgs.config.views import ViewKeys
from texgs.core.errors import ArgumentError
from texgs.workflow.edits import edit_keys, looks_of
from texgs.workflow.inputs import is_changed, shown_tfs, sweep_of_fit, view_settings
from texgs.workflow.stage import read
from texgs.workflow.sweep import fit_variant

if TYPE_CHECKING:
    from texgs.volume.transfer import TransferFunction


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


def basic_tfs_of(volume: Path, points: Mapping[str, BasicTF], tf_values: str) -> dict[str, TransferFunction]:
    """Return basic TFs in the units of a prepared volume, volume.nrrd with volume.json beside it."""
    from texgs.volume.summaries import read_summaries

    known, functions = read_summaries(volume), {}
    for name, each in points.items():
        if len(known) > 1 and each.channel not in known:
            raise ArgumentError(
                f"basic TF {name}: expected a channel of {volume} ({', '.join(known)}), got {each.channel}"
            )
        channel = [*known].index(each.channel) if each.channel in known else 0
        summary = [*known.values()][channel]
        bounds = summary["minimum"], summary["maximum"]
        functions[name] = in_data_values(name, each, tf_values, *bounds, channel)
    return functions


def in_data_values(
    name: str, points: BasicTF, tf_values: str, low: float, high: float, channel: int = 0
) -> TransferFunction:
    """Return a basic TF in the units of the data.

    Args:
        name: of the TF, for messages.
        points: of its opacity and colour.
        tf_values: "data", or "fraction" where the points are on fractions of the data's range.
        low: smallest value of the data.
        high: largest value of the data.
        channel: number of the one that these are of.
    """
    from texgs.volume.transfer import TransferFunction

    try:
        tf = TransferFunction(tuple(points.opacity), tuple(points.color), channel)
        tf = tf.scaled(low, high) if tf_values == "fraction" else tf
    except ArgumentError as error:
        raise ArgumentError(f"basic TF {name}: {error}") from error
    first, last = tf.support
    if first >= high or last <= low:
        raise ArgumentError(
            f"basic TF {name}: expected a range within the data's [{low:g}, {high:g}], got [{first:g}, "
            f"{last:g}]; is dataset.tf_values right?"
        )
    return tf
