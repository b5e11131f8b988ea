"""The legend of a scene: names, colours and ranges of values of what it shows."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from texgs.scene.scene import Scene
from texgs.scene.twin import edit_function, is_seen
from texgs.volume.label_masks import shows_label

Color = tuple[float, ...]
SAMPLES = 9  # colours of a function over its range


@dataclass(frozen=True)
class Entry:
    """A line of a legend."""

    name: str
    colors: list[Color]  # over the range, else one; in [0, 1]
    range: str = ""  # of values, such as "15 to 75"; "" if unknown, and of a label


def legend_of(scene: Scene, palettes: Sequence[Color]) -> list[Entry]:
    """Return a line for each visible model, and each visible segment that has a palette of its own.

    Args:
        scene: with its edits.
        palettes: of its models, as fitted: `Composed.palettes`.
    """
    entries = []
    for (name, model), palette in zip(scene.models.items(), palettes, strict=True):
        tf = scene.volume.tfs.get(name) if scene.volume else None
        own = {f"{name}/{key}": part.edit for key, part in model.segments.items()}
        for part, edit in {name: model.edit, **own}.items():
            if not is_seen(edit) or (part in own and edit.palette in (None, model.edit.palette)):
                continue
            if tf is None or not palette:
                entries += [Entry(part, [shown])] if (shown := edit.palette or palette) else []
                continue
            low, high = tf.support
            samples = edit_function(tf, edit, palette)(np.linspace(low, high, SAMPLES))
            colors = [tuple(rgb) for rgb in samples[:, :3].round(4).tolist()]
            words = "" if shows_label(tf) else f"{low:.4g} to {high:.4g}"
            entries.append(Entry(part, colors if len({*colors}) > 1 else [edit.palette or colors[0]], words))
    return entries
