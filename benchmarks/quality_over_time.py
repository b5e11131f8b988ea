"""How good a fit is after how many seconds: test views of one basic scene, for several recipes.

`python -m benchmarks.quality_over_time OUTPUT RECIPE,RECIPE... KEY=VALUE...` fits with each recipe in a
folder of its own and writes OUTPUT.csv and OUTPUT.png after each; words with = choose the data set and its
basic TF, as for `texgs texture`. The clock stands still while a model is looked at; views, seeds and starts
do not count. Rows that OUTPUT.csv has of other recipes stay, so that recipes can be measured one by one.
"""

from __future__ import annotations

import csv
import tempfile
import time
from collections.abc import Iterator
from functools import cached_property
from itertools import groupby
from pathlib import Path
from typing import NamedTuple
from unittest.mock import patch

from benchmarks.command import call
from texgs.cli.stage import ensure
from texgs.config.compose import compose
from texgs.core.memory import keep_freed_memory
from texgs.core.progress import progress
from texgs.fields.harmonics import join
from texgs.fields.surfels.model import Surfels
from texgs.fit.loop import Fit
from texgs.metrics.quality import evaluate, mean
from texgs.report.metrics_files import read
from texgs.volume.view_set import View, read_views
from texgs.workflow.result import METRICS
from texgs.workflow.stage_table import STAGES
from texgs.workflow.stages import phase

PHASES = ("surfels", "shading", "texture")
GROWTH, FIRST = 1.25, 0.5  # of the seconds between looks
EVERY = 8  # of the test views, while a phase runs


class Look(NamedTuple):
    """A row of the table."""

    recipe: str
    phase: str
    seconds: float  # of fitting, from the first iteration of the first phase
    psnr: float
    surfels: int
    is_final: bool  # measured on all test views by the phase itself


class Watch:
    """Runs the loops of phases and looks at their models.

    Args:
        recipe: that is run.
        folder: of its views.
        reduce: of their images.
    """

    def __init__(self, recipe: str, folder: Path, reduce: int) -> None:
        self.recipe, self.folder, self.reduce = recipe, folder, reduce
        self.phase, self.before, self.next = "", 0.0, FIRST
        self.looks: list[Look] = []

    def run_to_end(self, fit: Fit, _folder: Path, title: str) -> float:
        """In place of `texgs.fit.checkpoint.run_to_end`, without checkpoints."""
        seconds, start = 0.0, time.monotonic()
        for _ in progress(fit.run(), fit.iterations, title=title, unit="view"):
            if self.before + seconds + time.monotonic() - start >= self.next:
                seconds += time.monotonic() - start
                self.look(fit, self.before + seconds)
                start = time.monotonic()
        return seconds + time.monotonic() - start

    @cached_property
    def views(self) -> list[View]:
        """The test views to look at; they may be rendered by the first phase's needs."""
        return read_views(self.folder).test[::EVERY]

    def look(self, fit: Fit, seconds: float) -> None:
        """Add a row, and choose the time of the next."""
        model = Surfels({name: x.detach() for name, x in join(fit.parameters).items()}, fit.shading)
        psnr = mean(evaluate(model, self.views, self.reduce))["psnr"]
        self.looks.append(Look(self.recipe, self.phase, seconds, psnr, len(model), is_final=False))
        self.next = seconds * GROWTH


def main(output: str, recipes: str, *words: str) -> None:
    """Fit with all recipes; write the table and the figure."""
    keep_freed_memory()
    table = Path(f"{output}.csv")
    for recipe in recipes.split(","):
        others = [look for look in known(table) if look.recipe != recipe]
        looks = [*others, *looks_of(recipe, words)]
        with table.open("w", newline="") as file:
            csv.writer(file, lineterminator="\n").writerows([Look._fields, *looks])
        draw(looks, Path(f"{output}.png"))


def known(table: Path) -> list[Look]:
    """The rows that a table has already; none where there is no table."""
    if not table.exists():
        return []
    with table.open(newline="") as file:
        return [
            Look(
                row["recipe"],
                row["phase"],
                float(row["seconds"]),
                float(row["psnr"]),
                int(row["surfels"]),
                row["is_final"] == "True",
            )
            for row in csv.DictReader(file)
        ]


def looks_of(recipe: str, words: tuple[str, ...]) -> Iterator[Look]:
    """Fit with one recipe, phase by phase."""
    with tempfile.TemporaryDirectory() as folder:
        config = compose((*words, f"fit={recipe}", f"results={folder}", "tracking.uri=null"))
        watch = Watch(recipe, STAGES["shading"].inputs(config)["views"].parent, config.fit.reduce)
        for name in PHASES:
            watch.phase = name
            with patch.object(phase, "run_to_end", watch.run_to_end):
                ensure(name, config)
            yield from watch.looks
            watch.looks.clear()
            (record,) = read([STAGES[name].output(config) / METRICS])
            watch.before += record.result.fit_seconds
            if record.result.psnr is not None:
                quality = record.result.psnr, record.result.primitives
                yield Look(recipe, name, watch.before, *quality, is_final=True)


def draw(looks: list[Look], path: Path) -> None:
    """PSNR over seconds, a line for each recipe; phases end in dots."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 4), dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    for index, (recipe, rows) in enumerate(groupby(looks, key=lambda look: look.recipe)):
        own = list(rows)
        axes.plot([row.seconds for row in own], [row.psnr for row in own], color=f"C{index}", label=recipe)
        ends = [row for row in own if row.is_final]
        axes.plot([row.seconds for row in ends], [row.psnr for row in ends], "o", color=f"C{index}")
        for row in ends:
            place = row.seconds, row.psnr
            axes.annotate(row.phase, place, (4, -10), textcoords="offset points", fontsize=7)
    axes.set(xlabel="seconds of fitting", ylabel="PSNR of test views, dB", xscale="log")
    axes.margins(x=0.1)  # of which labels beside the dots need some
    axes.grid(which="both", alpha=0.2)
    axes.legend()
    figure.savefig(path)


if __name__ == "__main__":
    call(main)
