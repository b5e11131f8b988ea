"""Pictures side by side, a row each for what they are pictures of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.core.io import write_atomic
from texgs.core.plots import words

INCHES = 2.4  # of a picture
NOTE = 0.2  # inches, of words under it
DPI = 150
THRESHOLD = 0.02  # of the brightest value
MARGIN = 4  # pixels


def write_strip(
    path: str | Path,
    rows: Mapping[str, Sequence[np.ndarray | None]],
    titles: Sequence[str],
    below: Mapping[str, Sequence[str]] | None = None,
) -> Path:
    """Write a PNG with rows of pictures and a title over each column.

    All show the same part of theirs, the smallest square in which one differs from its corner.

    Args:
        path: target file.
        rows: pictures [H, W, 3] of one size by the name of the row, in [0, 1] or uint8; as many as titles.
            A place with None stays empty.
        titles: of the columns.
        below: words under the pictures of each row; by default there are none.

    Returns:
        The path.

    Raises:
        ArgumentError: if a row has another number of pictures.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    for name, pictures in rows.items():
        if len(pictures) != len(titles) or not titles:
            raise ArgumentError(f"{name}: expected {len(titles)} pictures, got {len(pictures)}")
    notes = below or {name: [""] * len(titles) for name in rows}
    box = content([picture for pictures in rows.values() for picture in pictures if picture is not None])
    size = (INCHES * len(titles), INCHES * len(rows) + 0.3 + NOTE * sum(map(any, notes.values())))
    figure = Figure(figsize=size, dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(len(rows), len(titles), squeeze=False)
    for line, (name, pictures) in zip(axes, rows.items(), strict=True):
        line[0].set_ylabel(words(name), fontsize=9)
        for at, picture, note in zip(line, pictures, notes[name], strict=True):
            at.set(xticks=[], yticks=[], frame_on=picture is not None)
            at.set_xlabel(words(note), fontsize=8)
            if picture is not None:
                at.imshow(picture[box])
    for at, title in zip(axes[0], titles, strict=True):
        at.set_title(words(title), fontsize=8)
    return write_atomic(path, lambda file: figure.savefig(file, format="png", metadata={"Software": None}))


def content(pictures: Sequence[np.ndarray]) -> tuple[slice, slice]:
    """Rows and columns of the smallest square, or what fits of it, with all that is not background."""
    seen = np.zeros(pictures[0].shape[:2], dtype=bool)
    for picture in pictures:
        seen |= np.abs(picture.astype(float) - picture[0, 0]).max(axis=2) > THRESHOLD * picture.max()
    if not seen.any():
        return slice(None), slice(None)
    places = [np.flatnonzero(seen.any(axis=axis)) for axis in (1, 0)]
    side = max(int(at[-1] - at[0]) + 1 + 2 * MARGIN for at in places)
    starts = [max(0, (int(at[0]) + int(at[-1]) + 1 - side) // 2) for at in places]
    return slice(starts[0], starts[0] + side), slice(starts[1], starts[1] + side)
