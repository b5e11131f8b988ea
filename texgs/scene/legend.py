"""The legend of a scene: names, colours and ranges of values of what it shows."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from texgs.scene.scene import Scene
from texgs.scene.twin import edit_function, is_seen
from texgs.volume.label_masks import HALF, INSIDE
from texgs.volume.transfer import TransferFunction

Color = tuple[float, ...]
SAMPLES = 9  # colours of a function over its range


@dataclass(frozen=True)
class Entry:
    """A line of a legend."""

    name: str
    colors: list[Color]  # over the range, else one; in [0, 1]
    range: str  # of values, such as "15 to 75"; "" if unknown, and of labels


def legend_of(scene: Scene, palettes: Sequence[Color]) -> list[Entry]:
    """Return a line for each visible model, and each visible segment that has a palette of its own.

    Args:
        scene: with its edits.
        palettes: of its models, as fitted: `Composed.palettes`.
    """
    tfs = scene.volume.tfs if scene.volume else {}
    entries = []
    for (name, model), palette in zip(scene.models.items(), palettes, strict=True):
        parts = {name: model.edit} | {
            f"{name}/{key}": segment.edit
            for key, segment in model.segments.items()
            if segment.edit.palette not in (None, model.edit.palette)
        }
        for part, edit in parts.items():
            if not is_seen(edit):
                continue
            tf = tfs.get(name)
            if tf is not None and palette:
                entries.append(Entry(part, colors_of(edit_function(tf, edit, palette)), range_of_values(tf)))
            elif shown := edit.palette or palette:
                entries.append(Entry(part, [shown], ""))
    return entries


def colors_of(tf: TransferFunction) -> list[Color]:
    """Return the colours of a function over its range; of a constant one, or of a label, its colour."""
    low, high = tf.support
    colors = [tuple(rgb) for rgb in tf(np.linspace(low, high, SAMPLES))[:, :3].round(4).tolist()]
    return colors[:1] if len({*colors}) == 1 else colors


def range_of_values(tf: TransferFunction) -> str:
    """Return the range of values that a function shows, as people write it; "" where it shows a label."""
    low, high = tf.support
    is_label = (tf.opacity[0][0], tf.opacity[-1][0]) == (HALF, INSIDE)
    return "" if is_label else f"{low:.4g} to {high:.4g}"
