"""What jobs read of the configuration: what all of them have, and what several share, such as basic TFs.

The module of a stage adds its own in a dataclass `Settings`; its function `select` takes the values from the
configuration. No field has a default, so a value that is not selected is an error.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from texgs.config.dataset import BasicTF
from texgs.config.views import ViewKeys
from texgs.core.errors import ArgumentError
from texgs.core.lens import Lens

if TYPE_CHECKING:
    from texgs.volume.transfer import TransferFunction


@dataclass
class OfDataset:
    """A job of a data set."""

    stage: str
    dataset: str
    stand_in: str  # what the data stand in for


@dataclass
class OfTF(OfDataset):
    """A job of one basic TF."""

    tf: str


@dataclass
class FitLabel:
    """Which fit this is, and what it runs on."""

    name: str
    field: str  # a kind of field
    seed: int
    sweep: str
    variant: str
    device: str
    changed: bool  # from the file of its name


@dataclass
class Recipe(FitLabel):
    """The same, with what all stages of a fit read."""

    reduce: int


@dataclass
class Distance:
    """Where cameras of pictures of a scene stand."""

    radius: float  # world units
    fov_y: float  # degrees

    @property
    def lens(self) -> Lens:
        """Of these cameras, but for the size of images."""
        return Lens(self.radius, self.fov_y)


@dataclass
class OfScene(OfDataset):
    """A job that compares a scene with its volume."""

    tf_values: str
    basic_tfs: dict[str, BasicTF]
    views: ViewKeys
    fit: FitLabel


def in_data_values(name: str, points: BasicTF, tf_values: str, low: float, high: float) -> TransferFunction:
    """Return a basic TF in the units of the data.

    Args:
        name: of the TF, for messages.
        points: of its opacity and colour.
        tf_values: "data", or "fraction" where the points are on fractions of the data's range.
        low: smallest value of the data.
        high: largest value of the data.
    """
    from texgs.volume.transfer import TransferFunction

    try:
        tf = TransferFunction(tuple(points.opacity), tuple(points.color))
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
