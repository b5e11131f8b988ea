"""The basic TFs of a configuration as functions of data values."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from texgs.config.dataset import BasicTF
from texgs.core.errors import ArgumentError

if TYPE_CHECKING:
    from texgs.volume.transfer import TransferFunction


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


def check_basic_tfs(dataset: Any) -> None:
    """Check the points of all basic TFs of a configuration, and that their ranges do not overlap.

    Args:
        dataset: the part `dataset` of the configuration.

    Raises:
        ArgumentError: naming the basic TF, or the two that overlap.
    """
    from texgs.volume.basic_tfs import check_disjoint
    from texgs.volume.transfer import TransferFunction

    basic = {}
    for name, points in dataset.basic_tfs.items():
        try:
            basic[name] = TransferFunction(points.opacity, points.color)
        except ArgumentError as error:
            raise ArgumentError(f"{dataset.name}: basic TF {name}: {error}") from error
    try:
        check_disjoint(basic)
    except ArgumentError as error:
        raise ArgumentError(f"{dataset.name}: basic TFs {error}") from error
