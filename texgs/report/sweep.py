"""The table of a sweep: means of each variant over all seeds."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from statistics import fmean, stdev
from typing import Any

from texgs.report.metrics_files import Record
from texgs.report.sweep_runs import DIGITS, MATERIAL, OF_EDITS, OF_FITS, Run, runs_of
from texgs.report.table import Cell, Column, Row, Table

KEY = (
    "data set",
    "TF",
    "recipe",
    "edit",
    "variant",
)  # of a row; columns that all rows leave empty are left out
SEEDS = "Means over seeds, ± their standard deviation."
CAPTIONS = {  # by the measures that they are about
    "PSNR": "Fits: test views after the last phase; minutes of all phases; medians of the material.",
    "NNFM": "Edits: minutes of the edit alone; distances to the style in views that it was not learned from.",
}


def sweep(records: Iterable[Record[Any]], name: str) -> Table:
    """The table of the variants among some jobs: a row for the fits of each, and one for each of its edits.

    Args:
        records: jobs; those of other fits and edits do not count.
        name: of the sweep.

    Raises:
        ArgumentError: if none is of the sweep.
    """
    groups: dict[tuple[str, ...], list[Run]] = defaultdict(list)
    for run in runs_of(records, name):
        groups[*run.series, run.variant].append(run)
    titles = measured(list(groups))
    spread = [
        title for title in titles if any(deviation(runs, title) is not None for runs in groups.values())
    ]
    named = [place for place in range(len(KEY)) if any(key[place] for key in groups)]
    rows = []
    for key, runs in groups.items():
        cells: list[Cell] = [*(key[place] or "-" for place in named), sum(bool(run.measures) for run in runs)]
        for title in titles:
            cells += [mean(runs, title), *([deviation(runs, title)] if title in spread else [])]
        rows.append(Row(cells, [path for run in runs for path in run.sources]))
    return Table(caption(titles, spread), columns([KEY[place] for place in named], titles, spread), rows)


def measured(keys: Sequence[tuple[str, ...]]) -> list[str]:
    """What is measured of fits, where there are some, and of edits."""
    of_fits = [*OF_FITS, *MATERIAL] if any(not key[3] for key in keys) else []
    of_edits = ["minutes", *OF_EDITS] if any(key[3] for key in keys) else []
    return list(dict.fromkeys([*of_fits, *of_edits]))


def columns(named: Sequence[str], titles: Sequence[str], spread: Sequence[str]) -> list[Column]:
    """What the cells of a row are."""
    header = [*map(Column, named), Column("seeds", 0)]
    for title in titles:
        header.append(Column(title, DIGITS[title]))
        if title in spread:
            header.append(Column(f"± {title}", DIGITS[title] + (DIGITS[title] == 0)))
    return header


def mean(runs: Sequence[Run], title: str) -> float | None:
    """The mean over the seeds that are done; None where a value is missing, or there is none."""
    known = values(runs, title)
    return fmean(known) if known else None


def deviation(runs: Sequence[Run], title: str) -> float | None:
    """The standard deviation over seeds; None where there are not several."""
    known = values(runs, title)
    return stdev(known) if len(known) > 1 else None


def values(runs: Sequence[Run], title: str) -> list[float]:
    """A measure of all runs that are done; none where one of them has not measured it."""
    numbers = [run.measures.get(title) for run in runs if run.measures]
    known = [value for value in numbers if value is not None]
    return known if len(known) == len(numbers) else []


def caption(titles: Sequence[str], spread: Sequence[str]) -> str:
    """What the columns are."""
    return " ".join(
        [*([SEEDS] if spread else []), *(words for title, words in CAPTIONS.items() if title in titles)]
    )
