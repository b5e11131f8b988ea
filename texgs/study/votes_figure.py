"""Figure of a user study, as the paper's: how often each method got each rank, over all data sets."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from texgs.core.figures import new_figure, words, write_figure
from texgs.report.sections import Figure, data_uri
from texgs.study.ballots import Votes
from texgs.study.questions import Compared, rank_name
from texgs.study.votes import THE_PAPER, Panel, compared, total

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WIDTH, DPI = 5.0, 150  # inches of a chart
BAR, AROUND = 0.35, 1.0  # inches of a bar, and of what is above and below all of a chart


def write_votes(path: str | Path, votes: Votes | None) -> Path:
    """Write a PNG with a chart for each kind of question, ours and the paper's below each other.

    Returns:
        The path.
    """
    charts = compared(votes)
    heights = [AROUND + BAR * len(panels[0].votes.methods) for _, panels in charts]
    figure = new_figure(WIDTH, sum(heights), DPI)
    places = figure.subplots(len(charts), squeeze=False, height_ratios=heights)[:, 0]
    for axes, (kind, panels) in zip(places, charts, strict=True):
        draw(axes, kind, panels)
    return write_figure(path, figure)


def shown(votes: Votes | None) -> Figure:
    """Return the figure as a report has it."""
    with TemporaryDirectory() as folder, Image.open(write_votes(Path(folder, "votes.png"), votes)) as picture:
        command = "texgs votes" if votes else ""
        return Figure("votes", "", "Votes for each rank.", data_uri(picture), command, is_narrow=True)


def draw(axes: Axes, kind: str, panels: Sequence[Panel]) -> None:
    """A bar for each method, of its votes from the best rank to the worst."""
    from matplotlib import colormaps  # slow to import

    votes = total(panels)
    names, count = [words(name_of(method)) for method in votes.methods], len(votes.methods)
    starts = np.zeros(count)
    for rank, column in enumerate(votes.counts.T, start=1):
        color = colormaps["viridis"](1 - (rank - 0.5) / count)
        axes.barh(names, column, left=starts, height=0.7, color=color, label=rank_name(rank, count))
        starts += column
    axes.invert_yaxis()
    axes.set_xlim(0, votes.number)
    axes.set_xlabel("votes", fontsize=8)
    axes.tick_params(labelsize=8)
    axes.spines[["top", "right"]].set_visible(False)
    source = f", {THE_PAPER}" if votes.methods[0].edit == THE_PAPER else ""
    axes.set_title(f"{kind}{source}: {votes.number} rankings of {len(panels)} questions", fontsize=9)
    axes.legend(fontsize=7, ncols=count, loc="upper center", bbox_to_anchor=(0.5, -0.25), frameon=False)


def name_of(method: Compared) -> str:
    """Return what a bar is called."""
    return method.method if method.edit == THE_PAPER else f"{method.edit}\n{method.recipe}"
