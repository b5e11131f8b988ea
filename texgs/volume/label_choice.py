"""Which labels a volume has, and which of them are shown."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.volume.label_masks import label_counts
from texgs.volume.label_names import Label, label_of
from texgs.volume.nrrd_file import open_prepared
from texgs.volume.prepare import bounds_of
from texgs.volume.slabs import Source
from texgs.volume.suggest import looks_like_labels


def has_few_values(summary: Mapping[str, Any]) -> bool:
    """Return whether samples of a volume have as few values as labels have, by its summary."""
    extent = summary["maximum"] - summary["minimum"]
    return not summary.get("robust") and looks_like_labels(np.array(summary["histogram"]), extent)


def holds_labels(volume: Path) -> bool:
    """Return whether samples of a prepared volume are whole numbers, of any type, and not all 0."""
    with suppress(ArgumentError):
        return bool(label_counts(open_prepared(volume)[0]))
    return False


def labels_in(
    open_layer: Callable[[str | None], Source], known: Sequence[Label], crop: Sequence[int] | None = None
) -> list[Label]:
    """Return the labels that samples in a crop have, the largest first, with what is known of them.

    Args:
        open_layer: returns a layer of the volume, by the name that labels give it; most often None.
        known: names and colours.
        crop: as for `prepare_channels`.

    Raises:
        ArgumentError: if a sample is no whole number, or all are 0.
    """
    found = []
    for layer in dict.fromkeys(each.layer for each in known) or [None]:
        source = open_layer(layer)
        named = {each.number: each for each in known if each.layer == layer}
        for number, samples in label_counts(source, bounds_of(source.dims, crop)).items():
            each = named.get(number, Label(number, str(number), layer=layer))
            found.append(each._replace(samples=samples))
    if not found:
        raise ArgumentError(f"{source.name}: expected labels, got 0 everywhere")
    return sorted(found, key=lambda each: -each.samples)


def choose(found: Sequence[Label], wanted: Sequence[str] | None, most: int, least: int = 1) -> list[Label]:
    """Return wanted labels, by names or numbers, or the `most` largest of `least` samples, by number."""
    if wanted is None:
        large = [each for each in found if each.samples >= least]
        return sorted(large[:most], key=lambda each: each.number)
    if not 0 < len(wanted) <= most:
        raise ArgumentError(f"labels: expected 1 to {most} labels, got {len(wanted)}; leave some out")
    chosen = {word: label_of(word, found) for word in wanted}
    for word, label in chosen.items():
        if label is None:
            known = ", ".join(each.name for each in found)
            raise ArgumentError(f"labels: no such label {word!r}; expected some of {known}")
    return list(dict.fromkeys(filter(None, chosen.values())))
