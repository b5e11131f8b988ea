"""Reproducible Matplotlib figures without a screen, and grids of pictures."""

from __future__ import annotations

import io
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image

from texgs.core.errors import ArgumentError
from texgs.core.io import write_atomic

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from torch import Tensor

DPI = 200
LEFT, CELL, GAP = 0.3, 1.86, 0.08  # inches: row names, a cell, and the gap after it
COLUMNS = 5  # of a 10-inch page; rows with more cells have narrower ones
TOP, HEAD, FOOT = 0.4, 0.25, 0.28  # inches: page title, and the lines above and below a cell
LINE = 0.15  # inches of each further line of a title
LARGE, MEDIUM, SMALL = 11, 9, 8  # font sizes, points
LETTER = 0.6  # mean width of a letter, in font sizes
CENTERED: dict[str, Any] = {"ha": "center", "va": "center"}
THRESHOLD = 0.02  # difference from the background, as a share of the brightest value
MARGIN = 4  # pixels


def new_figure(width: float, height: float, dpi: float, layout: str | None = "constrained") -> Figure:
    """Return an empty figure, size in inches; without a layout, axes keep their places."""
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
    """Escape a text so that Matplotlib shows dollar signs instead of reading mathematics."""
    return text.replace("$", r"\$")


@dataclass(frozen=True)
class Scale:
    """A colour map over a range of values."""

    low: float
    high: float
    colormap: str = "viridis"

    def __call__(self, values: Tensor) -> Tensor:
        """Return colours [..., 3] of values [...]."""
        import torch
        from matplotlib import colormaps  # slow to import

        shares = ((values - self.low) / (self.high - self.low)).clamp(0, 1)
        return torch.from_numpy(colormaps[self.colormap](shares.cpu().numpy())[..., :3]).float()


@dataclass(frozen=True, eq=False)
class Cell:
    """One picture, words instead of it, or nothing."""

    title: str = ""
    pixels: Tensor | np.ndarray | None = None  # [H, W, 3] in [0, 1] or uint8
    words: str = ""  # below the picture
    scale: Scale | None = None  # below the picture, instead of words


@dataclass(frozen=True, eq=False)
class Row:
    """Cells side by side."""

    name: str
    cells: Sequence[Cell]

    @property
    def head(self) -> float:
        """Return the inches above the cells."""
        lines = max(cell.title.count("\n") + 1 if cell.title else 0 for cell in self.cells)
        return HEAD + LINE * (lines - 1) if lines else 0.0

    @property
    def foot(self) -> float:
        """Return the inches below the cells."""
        has_words = any(cell.scale or (cell.words and cell.pixels is not None) for cell in self.cells)
        return FOOT if has_words else GAP


def write_grid(
    path: str | Path,
    rows: Mapping[str, Sequence[np.ndarray | None]],
    titles: Sequence[str],
    below: Mapping[str, Sequence[str]] | None = None,
    more: Sequence[Row] = (),
) -> Path:
    """Write a PNG with rows of pictures and a title over each column, and more rows below them.

    Pictures [H, W, 3] are of one size, in [0, 1] or uint8, by the name of the row; a place with None stays
    empty. All show the same part of theirs, the smallest square in which one differs from its corner.
    """
    return draw(path, [*grid_rows(rows, titles, below), *more], columns=len(titles))


def grid_rows(
    rows: Mapping[str, Sequence[np.ndarray | None]],
    titles: Sequence[str],
    below: Mapping[str, Sequence[str]] | None = None,
) -> list[Row]:
    """Return the rows of `write_grid`."""
    for name, pictures in rows.items():
        if len(pictures) != len(titles) or not titles:
            raise ArgumentError(f"{name}: expected {len(titles)} pictures, got {len(pictures)}")
    none = [""] * len(titles)
    box = content([picture for pictures in rows.values() for picture in pictures if picture is not None])
    grid = []
    for index, (name, pictures) in enumerate(rows.items()):
        cells = zip(none if index else titles, pictures, below[name] if below else none, strict=True)
        grid.append(Row(name, [Cell(t, None if p is None else p[box], n) for t, p, n in cells]))
    return grid


def draw(path: str | Path, rows: Sequence[Row], title: str = "", columns: int = COLUMNS) -> Path:
    """Write rows, whose pictures are of one size, as PNG; see `lay_out`."""
    return write_figure(path, lay_out(rows, title, columns))


def lay_out(rows: Sequence[Row], title: str = "", columns: int = COLUMNS) -> Figure:
    """Lay out rows of equally large pictures in a figure with at most a given number of columns."""
    height, width = next(x.pixels.shape[:2] for row in rows for x in row.cells if x.pixels is not None)
    columns = min(columns, max(len(row.cells) for row in rows))
    across = columns * (CELL + GAP)
    widths = [across / len(row.cells) - GAP if len(row.cells) > columns else CELL for row in rows]
    heights = [wide * height / width for wide in widths]
    top = TOP if title else GAP
    page = top + sum(heights) + sum(row.head + row.foot for row in rows)
    figure = new_figure(LEFT + across, page, DPI, layout=None)
    figure.text(LEFT / (LEFT + across), 1 - 0.5 * TOP / page, words(title), fontsize=LARGE, va="center")
    for row, wide, tall in zip(rows, widths, heights, strict=True):
        top += row.head
        draw_row(figure, row, top, wide, tall)
        top += tall + row.foot
    return figure


def draw_row(figure: Figure, row: Row, top: float, wide: float, tall: float) -> None:
    """Draw a row of cells; sizes and the distance from the upper border are in inches."""
    page_width, page = figure.get_size_inches()

    def axes_at(left: float, top: float, width: float, height: float) -> Axes:
        """Return axes without ticks in a grey frame, by inches from the upper left corner."""
        box = (left / page_width, 1 - (top + height) / page, width / page_width, height / page)
        axes = figure.add_axes(box, xticks=[], yticks=[])
        axes.spines[:].set(color="0.8", linewidth=0.5)
        return axes

    size = fitting([cell.title for cell in row.cells], wide)
    small = min(SMALL, fitting([cell.words for cell in row.cells if cell.pixels is not None], wide + GAP))
    for index, cell in enumerate(row.cells):
        left = LEFT + index * (wide + GAP)
        if cell.pixels is not None or cell.words or cell.title:
            fill(axes_at(left, top, wide, tall), cell, size, small)
        if cell.scale is not None:
            fill_bar(axes_at(left + 0.33 * wide, top + tall + 0.07, 0.34 * wide, 0.1), cell.scale)
    x, y = 0.5 * LEFT / page_width, 1 - (top + 0.5 * tall) / page
    figure.text(x, y, words(row.name), rotation=90, fontsize=fitting([row.name], tall), **CENTERED)


def fitting(texts: Iterable[str], inches: float) -> float:
    """Return the font size, points, at which the longest line of some texts fits."""
    longest = max((len(line) for text in texts for line in text.splitlines()), default=0)
    return min(MEDIUM, 72 * inches / (LETTER * max(longest, 1)))


def fill(axes: Axes, cell: Cell, size: float, small: float) -> None:
    """Draw a cell: its picture or words, with the title above and the caption below, in these font sizes."""
    axes.set_title(words(cell.title), fontsize=size, pad=4)
    if cell.pixels is None:
        axes.set_frame_on(bool(cell.words))
        place = {"transform": axes.transAxes, **CENTERED}
        axes.text(0.5, 0.5, cell.words, family="monospace", fontsize=MEDIUM, **place)
        return
    axes.imshow(np.asarray(cell.pixels), aspect="auto")
    axes.set_xlabel(words(cell.words), fontsize=small, labelpad=4)


def fill_bar(axes: Axes, scale: Scale) -> None:
    """Draw the colour bar of a scale with the values at its ends."""
    import torch

    axes.imshow(scale(torch.linspace(scale.low, scale.high, 256))[None].numpy(), aspect="auto")
    for x, value, side in ((-0.1, scale.low, "right"), (1.1, scale.high, "left")):
        axes.text(x, 0.4, f"{value:.3g}", transform=axes.transAxes, fontsize=SMALL, ha=side, va="center")


def content(pictures: Sequence[np.ndarray]) -> tuple[slice, slice]:
    """Return rows and columns of the smallest square, clipped to the image, around the content."""
    seen = np.zeros(pictures[0].shape[:2], dtype=bool)
    for picture in pictures:
        seen |= np.abs(picture.astype(float) - picture[0, 0]).max(axis=2) > THRESHOLD * picture.max()
    if not seen.any():
        return slice(None), slice(None)
    places = [np.flatnonzero(seen.any(axis=axis)) for axis in (1, 0)]
    side = max(int(at[-1] - at[0]) + 1 + 2 * MARGIN for at in places)
    starts = [max(0, (int(at[0]) + int(at[-1]) + 1 - side) // 2) for at in places]
    return slice(starts[0], starts[0] + side), slice(starts[1], starts[1] + side)
