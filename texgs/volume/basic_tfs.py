"""Basic transfer functions as configurations have them, and in the units of a volume."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from texgs.core.errors import ArgumentError, errors_at
from texgs.core.keys import key
from texgs.core.names import mask_name

if TYPE_CHECKING:
    from texgs.volume.transfer import TransferFunction

MAX_CHANNELS = 16  # and masks, of a data set: the caster shows so many together


@dataclass(frozen=True)
class BasicTF:
    """A basic transfer function: piecewise linear opacity and colour over one range of values."""

    # OmegaConf takes no integers for list[list[float]]; the points are checked where the TF is made.
    opacity: list[Any] = key([], "points [value, opacity]; opacity is 0 outside")
    color: list[Any] = key([], "points [value, r, g, b], linear, 0 to 1")
    channel: str | None = key(
        None, "label or number of the channel of these values, from 0, where the data set shows several"
    )
    label: str | None = key(None, "name or number of the label that is shown, by 0 to 255 of its mask")
    within: str | None = key(None, "name or number of the label that values are shown in, and nowhere else")

    @property
    def values_of(self) -> str | None:
        """Return what of a prepared volume its values are of, by the names of `read_summaries`."""
        return self.channel if self.label is None else mask_name(self.label)


def basic_tf_of(tf: TransferFunction, prepared: Sequence[str]) -> BasicTF:
    """Return the basic TF of a function of prepared channels, by the names of these.

    Raises:
        ArgumentError: if there is no such channel, or `within` is not that of a mask.
    """
    points, mark = tf.to_dict(), mask_name("")
    masks = {k: name.removeprefix(mark) for k, name in enumerate(prepared) if name.startswith(mark)}
    for of, number, known in (("channel", tf.channel, range(len(prepared))), ("within", tf.within, masks)):
        if number not in (None, *known):
            raise ArgumentError(f"{of}: expected one of {[*known]}, got {number}")
    channel = None if tf.channel in masks else prepared[tf.channel] or None
    within = None if tf.within is None else masks[tf.within]
    return BasicTF(points["opacity"], points["color"], channel, masks.get(tf.channel), within)


def function_of(tf: BasicTF, prepared: Sequence[str]) -> TransferFunction:
    """Return the function of prepared channels, by their names, that a basic TF is; of values as given.

    Raises:
        ArgumentError: if it is of another channel, where there are several, or its points are malformed.
    """
    from texgs.volume.transfer import TransferFunction

    wanted = [(tf.values_of or "") if len(prepared) > 1 else prepared[0]]
    wanted += [] if tf.within is None else [mask_name(tf.within)]
    for each in wanted:
        if each not in prepared:
            raise ArgumentError(f"expected a channel of {', '.join(prepared)}, got {each or None}")
    return TransferFunction(tuple(tf.opacity), tuple(tf.color), *map(prepared.index, wanted))


def basic_tfs_of(volume: Path, points: Mapping[str, BasicTF], tf_values: str) -> dict[str, TransferFunction]:
    """Return basic TFs in the units of a prepared volume, volume.nrrd with volume.json beside it."""
    from texgs.volume.summaries import read_summaries

    known, functions = read_summaries(volume), {}
    for name, each in points.items():
        with errors_at(f"basic TF {name}"):
            tf = function_of(each, [*known])
            summary = [*known.values()][tf.channel]
            values = tf_values if each.label is None else "data"  # of masks: 0 to 255
            functions[name] = in_data_values(tf, values, summary["minimum"], summary["maximum"])
    return functions


def in_data_values(tf: TransferFunction, tf_values: str, low: float, high: float) -> TransferFunction:
    """Return a function in the units of data from low to high.

    Its values are in these ("data"), or they are fractions of the data's range ("fraction").
    """
    tf = tf.scaled(low, high) if tf_values == "fraction" else tf
    first, last = tf.support
    if first >= high or last <= low:
        raise ArgumentError(
            f"expected a range within the data's [{low:g}, {high:g}], got [{first:g}, {last:g}]; is "
            "dataset.tf_values right?"
        )
    return tf
