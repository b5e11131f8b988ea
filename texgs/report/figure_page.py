"""A page of pictures in rows, with titles, numbers and scales of colours."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import torch
from torch import Tensor

from texgs.core.io import write_atomic
from texgs.core.plots import words

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DPI = 200
LEFT, PANEL, GAP = 0.3, 1.86, 0.08  # inches: the names of the rows, a panel, and what is free behind it
COLUMNS = 5  # of the widest page, 10 inches; panels of a row with more are narrower
TOP, HEAD, FOOT = 0.4, 0.25, 0.28  # the title of the page, and the lines above and below a panel
LARGE, MEDIUM, SMALL = 11, 9, 8  # points
CENTERED: dict[str, Any] = {"fontsize": MEDIUM, "ha": "center", "va": "center"}


@dataclass(frozen=True)
class Scale:
    """Which colours stand for which values."""

    low: float
    high: float
    colormap: str = "viridis"

    def __call__(self, values: Tensor) -> Tensor:
        """Colours [..., 3] of values [...]."""
        from matplotlib import colormaps  # slow to import

        shares = ((values - self.low) / (self.high - self.low)).clamp(0, 1)
        return torch.from_numpy(colormaps[self.colormap](shares.numpy())[..., :3]).float()


@dataclass(frozen=True, eq=False)
class Panel:
    """One picture of the figure, or words in its place."""

    title: str
    pixels: Tensor | None = None  # [H, W, 3] in [0, 1]
    words: str = ""  # below the picture
    scale: Scale | None = None  # below the picture, instead of words


@dataclass(frozen=True, eq=False)
class PanelRow:
    """Panels side by side."""

    name: str
    panels: list[Panel]


def draw(path: str | Path, rows: list[PanelRow], title: str) -> Path:
    """Lay out rows of panels, whose pictures are of one size, and write them as PNG."""
    from matplotlib.figure import Figure  # slow to import

    height, width = next(panel.pixels.shape[:2] for panel in rows[0].panels if panel.pixels is not None)
    columns = min(COLUMNS, max(len(row.panels) for row in rows))
    across, widths = columns * (PANEL + GAP), [PANEL] * len(rows)
    for index, row in enumerate(rows):
        if len(row.panels) > columns:
            widths[index] = across / len(row.panels) - GAP
    heights = [wide * height / width for wide in widths]
    page_width, page = LEFT + across, TOP + sum(heights) + len(rows) * (HEAD + FOOT)
    figure = Figure(figsize=(page_width, page), dpi=DPI, facecolor="white")

    def axes_at(left: float, top: float, width: float, height: float) -> Axes:
        """Axes without ticks in a grey frame, by inches from the upper left corner."""
        box = (left / page_width, 1 - (top + height) / page, width / page_width, height / page)
        axes = figure.add_axes(box, xticks=[], yticks=[])
        axes.spines[:].set(color="0.8", linewidth=0.5)
        return axes

    figure.text(LEFT / page_width, 1 - 0.5 * TOP / page, words(title), fontsize=LARGE, va="center")
    top = TOP
    for row, wide, tall in zip(rows, widths, heights, strict=True):
        top += HEAD
        for index, panel in enumerate(row.panels):
            left = LEFT + index * (wide + GAP)
            fill(axes_at(left, top, wide, tall), panel)
            if panel.scale is not None:
                bar = axes_at(left + 0.33 * wide, top + tall + 0.07, 0.34 * wide, 0.1)
                fill_bar(bar, panel.scale)
        figure.text(
            0.5 * LEFT / page_width, 1 - (top + 0.5 * tall) / page, words(row.name), rotation=90, **CENTERED
        )
        top += tall + FOOT
    return write_atomic(path, lambda file: figure.savefig(file, format="png"))


def fill(axes: Axes, panel: Panel) -> None:
    """The picture with its title above and its words below, or the words in its place."""
    axes.set_title(panel.title, fontsize=MEDIUM, pad=4)
    if panel.pixels is None:
        axes.text(0.5, 0.5, panel.words, transform=axes.transAxes, family="monospace", **CENTERED)
        return
    axes.imshow(panel.pixels.numpy(), aspect="auto")
    axes.set_xlabel(panel.words, fontsize=SMALL, labelpad=4)


def fill_bar(axes: Axes, scale: Scale) -> None:
    """All colours of a scale, between the values of its ends."""
    axes.imshow(scale(torch.linspace(scale.low, scale.high, 256))[None].numpy(), aspect="auto")
    for x, value, side in ((-0.1, scale.low, "right"), (1.1, scale.high, "left")):
        axes.text(x, 0.4, f"{value:.3g}", transform=axes.transAxes, fontsize=SMALL, ha=side, va="center")
