"""Labels of a volume in Python, alone or beside an image: their masks and functions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from texgs.config.label_tfs import label_tfs
from texgs.core.errors import ArgumentError
from texgs.core.names import check_count
from texgs.volume.basic_tfs import MAX_CHANNELS, BasicTF
from texgs.volume.label_choice import choose, labels_in
from texgs.volume.label_masks import MaskSource, on_lattice_of
from texgs.volume.label_names import named_in
from texgs.volume.slabs import Source


def sources_of(
    data: Any,
    open_file: Callable[..., Source],
    kind: str,
    labels: Any,
    table: str | Path | None,
    crop: Sequence[int] | None,
    reduce: int,
) -> tuple[dict[str, BasicTF], list[Source]]:
    """Return the basic TFs of labels, and an image, if there is one, before their masks.

    Arguments are as for `texgs.Volume`, and what opens data, where labels overlap a layer of them. A label of
    fewer samples than a reduced block has is only shown where it is wanted.
    """
    if kind not in ("image", "labels"):
        raise ArgumentError(f"kind: expected image or labels, got {kind!r:.100}")
    check_count("reduce", reduce)
    images = [open_file(data, None)] if kind == "image" else []
    if images and labels is None:
        return {}, images
    of, wanted = (labels, None) if images else (data, labels)
    if isinstance(wanted, str) or not isinstance(wanted, Sequence | None):
        raise ArgumentError(f"labels: expected names or numbers, as in [3, 'liver'], got {wanted!r:.100}")

    @cache
    def layer_of(layer: str | None) -> Source:
        if not images:
            return open_file(of, layer)
        return on_lattice_of(open_file(of, layer, name="labels", keys={}), images[0])

    known, _ = named_in(*(Path(each) if isinstance(each, str | Path) else None for each in (of, table)))
    words = None if wanted is None else [*map(str, wanted)]
    chosen = choose(labels_in(layer_of, known, crop), words, MAX_CHANNELS - len(images), reduce**3)
    masks = [MaskSource(layer_of(each.layer), each.number, each.name) for each in chosen]
    return label_tfs(chosen), [*images, *masks]
