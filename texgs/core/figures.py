"""Figures of Matplotlib: they are made without a screen, and the same numbers give the same bytes."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING

from PIL import Image

from texgs.core.io import write_atomic

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def new_figure(width: float, height: float, dpi: int, layout: str | None = "constrained") -> Figure:
    """Return an empty figure of a size in inches; without a layout its axes stay where they are put."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # slow to import
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), dpi=dpi, layout=layout, facecolor="white")  # type: ignore[arg-type]
    FigureCanvasAgg(figure)
    return figure


def write_figure(path: str | Path, figure: Figure) -> Path:
    """Write a figure as PNG in one step."""
    return write_atomic(path, lambda file: figure.savefig(file, format="png", metadata={"Software": None}))


def as_picture(figure: Figure) -> Image.Image:
    """Return a figure as a picture."""
    file = io.BytesIO()
    figure.savefig(file, format="png")
    return Image.open(file)


def words(text: str) -> str:
    r"""Return a text that Matplotlib shows letter by letter: between dollar signs it expects mathematics.

    Example:
        >>> words("$x_{")
        '\\$x_{'
    """
    return text.replace("$", r"\$")
