"""Basic transfer functions as configurations have them, and in the units of a volume."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from texgs.core.errors import ArgumentError
from texgs.core.keys import key
from texgs.core.names import mask_name

if TYPE_CHECKING:
    from texgs.volume.transfer import TransferFunction


@dataclass(frozen=True)
class BasicTF:
    """A basic transfer function: piecewise linear opacity and colour over one range of values."""

    # OmegaConf takes no integers for list[list[float]]; the points are checked where the TF is made.
    opacity: list[Any] = key([], "points [value, opacity]; opacity is 0 outside")
    color: list[Any] = key([], "points [value, r, g, b], linear, 0 to 1")
    channel: str | None = key(
        None, "label or number of the channel of these values, from 0, where the data set shows several"
    )
    label: str | None = key(
        None, "name or number of the label that is shown: values are 0 to 255 of its mask"
    )
    within: str | None = key(
        None, "name or number of the label that values are shown in; elsewhere nothing is"
    )

    @property
    def values_of(self) -> str | None:
        """Return what of a prepared volume its values are of, by the names of `read_summaries`."""
        return self.channel if self.label is None else mask_name(self.label)


def basic_tf_of(tf: TransferFunction, prepared: Sequence[str]) -> BasicTF:
    """Return the basic TF of a function of prepared channels, by the names of these.

    Raises:
        ArgumentError: if there is no such channel, or `within` is not that of a mask.
    """
    labels = [
        name.partition(mask_name(""))[2] if name.startswith(mask_name("")) else None for name in prepared
    ]
    for name, number in (("channel", tf.channel), ("within", tf.within)):
        known = [k for k, each in enumerate(labels) if name == "channel" or each is not None]
        if number not in (None, *known):
            raise ArgumentError(f"{name}: expected one of {known}, got {number}")
    channel = None if labels[tf.channel] else prepared[tf.channel] or None
    within = None if tf.within is None else labels[tf.within]
    points = tf.to_dict()
    return BasicTF(points["opacity"], points["color"], channel, labels[tf.channel], within)


def function_of(tf: BasicTF, prepared: Sequence[str]) -> TransferFunction:
    """Return the function of prepared channels, by their names, that a basic TF is; of values as given."""
    from texgs.volume.transfer import TransferFunction

    mask = None if tf.within is None else prepared.index(mask_name(tf.within))
    of = prepared.index(tf.values_of or "")
    return TransferFunction(tuple(tf.opacity), tuple(tf.color), of, mask)


def basic_tfs_of(volume: Path, points: Mapping[str, BasicTF], tf_values: str) -> dict[str, TransferFunction]:
    """Return basic TFs in the units of a prepared volume, volume.nrrd with volume.json beside it."""
    from texgs.volume.summaries import read_summaries

    known, functions = read_summaries(volume), {}
    for name, each in points.items():
        wanted = each.values_of or "" if len(known) > 1 else next(iter(known))
        mask = None if each.within is None else mask_name(each.within)
        for channel in (wanted if len(known) > 1 else None, mask):
            if channel is not None and channel not in known:
                expected = f"expected a channel of {volume} ({', '.join(known)})"
                raise ArgumentError(f"basic TF {name}: {expected}, got {channel or None}")
        number = [*known].index(wanted) if wanted in known else 0
        summary = [*known.values()][number]
        values = tf_values if each.label is None else "data"  # of masks: 0 to 255
        tf = in_data_values(name, each, values, summary["minimum"], summary["maximum"], number)
        functions[name] = tf if mask is None else replace(tf, within=[*known].index(mask))
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
