"""Labels of a volume in Python, alone or beside an image: their masks, and the names of their functions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from texgs.config.dataset_labels import named
from texgs.core.errors import ArgumentError
from texgs.volume.grid import MAX_CHANNELS
from texgs.volume.label_choice import choose, labels_in
from texgs.volume.label_masks import MaskSource, on_lattice_of
from texgs.volume.label_names import Label, named_in, read_table
from texgs.volume.slabs import Source


def masks_of(
    data: Any,
    open_layer: Callable[[str | None], Source],
    image: Source | None,
    wanted: Sequence[str | int] | None,
    table: str | Path | None,
    crop: Sequence[int] | None,
) -> tuple[dict[str, Label], list[Source]]:
    """Return labels, by the names of their functions, and their masks.

    Args:
        data: a file or an array of labels.
        open_layer: returns its samples; where labels overlap, those of a layer.
        image: that the labels are beside, if any.
        wanted: names or numbers; default the largest that there is room for.
        table: names and colours, see `texgs.volume.label_names.read_table`.
        crop: as for `texgs.Volume`.
    """
    if isinstance(wanted, str) or not isinstance(wanted, Sequence | None):
        raise ArgumentError(f"labels: expected names or numbers, as in [3, 'liver'], got {wanted!r:.100}")
    path = None if table is None else Path(table)
    if isinstance(data, str | Path):
        known, _ = named_in(Path(data), path)
    else:
        known = [] if path is None else read_table(path)

    @cache
    def layer_of(layer: str | None) -> Source:
        labels = open_layer(layer)
        return labels if image is None else on_lattice_of(labels, image)

    words = None if wanted is None else [*map(str, wanted)]
    chosen = choose(labels_in(layer_of, known, crop), words, MAX_CHANNELS - (image is not None))
    return named(chosen), [MaskSource(layer_of(each.layer), each.number, each.name) for each in chosen]
