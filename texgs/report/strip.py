"""Pictures side by side, a row each for what they are pictures of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.core.io import write_atomic

INCHES = 2.4  # of a picture
DPI = 150


def write_strip(path: str | Path, rows: Mapping[str, Sequence[np.ndarray]], titles: Sequence[str]) -> Path:
    """Write a PNG with rows of pictures and a title over each column.

    Args:
        path: target file.
        rows: pictures [H, W, 3] by the name of the row, in [0, 1] or uint8; as many as titles.
        titles: of the columns.

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
    size = (INCHES * len(titles), INCHES * len(rows) + 0.3)
    figure = Figure(figsize=size, dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(len(rows), len(titles), squeeze=False)
    for row, (name, pictures) in enumerate(rows.items()):
        for column, picture in enumerate(pictures):
            at = axes[row, column]
            at.imshow(picture)
            at.set_xticks([])
            at.set_yticks([])
            if row == 0:
                at.set_title(titles[column], fontsize=8)
            if column == 0:
                at.set_ylabel(name, fontsize=9)
    return write_atomic(path, lambda file: figure.savefig(file, format="png", metadata={"Software": None}))
