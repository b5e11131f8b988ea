"""Tables `views` and `resolution`: what a fit gains from more training views, and from larger ones."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from texgs.fit.kinds import fit_specs
from texgs.report.means import mean
from texgs.report.metrics_files import Record, of, paper
from texgs.report.published import (
    ALIKE,
    THEIRS,
    Key,
    Line,
    Ours,
    beside,
    in_order,
    is_alike,
    numbers,
    side_by_side,
)
from texgs.report.results import FitResult
from texgs.report.table import UNPUBLISHED, Cell, Column, Row, Table

MEASURES = (
    Column("PSNR, training", 2),
    Column("SSIM, training", 4),
    Column("PSNR", 2),
    Column("SSIM", 4),
    Column("minutes", 2),
    Column("primitives", 0),
)
KEYS = ("train_psnr", "train_ssim", "test_psnr", "test_ssim", "fitting_min", "primitives")
HEADINGS = {"views": "training views", "resolution": "pixels"}  # of the variants, by the sweep
Run = dict[str, Record[FitResult]]  # by phase


def ablation(records: Iterable[Record[Any]], sweep: str) -> Table:
    """The table of one of the paper's sweeps among some jobs: means over seeds and basic scenes.

    Args:
        records: jobs; those of other sweeps do not count.
        sweep: a key of `HEADINGS`; the names of its like begin with it, such as `views_quick`.
    """
    groups: dict[tuple[str, str, str], dict[tuple[str | None, int], Run]] = {}
    for record in in_order(of(FitResult, records)):
        if record.variant and (record.sweep == sweep or record.sweep.startswith(f"{sweep}_")):
            runs = groups.setdefault((record.title, record.recipe, record.variant), defaultdict(dict))
            runs[record.tf, record.seed][record.stage] = record
    published = paper(sweep, keys=2)
    ordered = sorted(groups.items(), key=lambda item: (len(item[0][2]), item[0][2]))  # numbers, as words
    ours = [row_of(list(runs.values()), sweep, published) for _, runs in ordered]
    return Table(ALIKE, columns(sweep), side_by_side(ours, published, theirs))


def columns(sweep: str) -> list[Column]:
    """Those of the table of a sweep."""
    labels = [Column("data set"), Column("recipe"), Column(HEADINGS[sweep]), Column("basic scenes", 0)]
    published = [Column(f"{column.title} (paper)", column.digits, UNPUBLISHED) for column in MEASURES]
    return [*labels, *MEASURES, *published]


def row_of(runs: Sequence[Run], sweep: str, published: Mapping[Key, Line]) -> Ours:
    """One variant; what is not measured of all its basic scenes is None."""
    first = next(iter(runs[0].values()))
    ends = [end_of(run) for run in runs]
    measured = [mean(column) for column in zip(*map(measures, runs, ends), strict=True)]
    key = (first.dataset, first.variant)
    alike = all(end is not None and is_alike_in(sweep, end) for end in ends)
    line = None if first.stand_in else published.get(key)
    scenes = len({part.tf for run in runs for part in run.values()})
    cells: list[Cell] = [first.title, first.recipe, first.variant, scenes, *measured]
    sources = [part.path for run in runs for part in run.values()]
    return Ours(Row([*cells, *beside(line, KEYS, alike)], sources), first, key, alike)


def end_of(run: Run) -> Record[FitResult] | None:
    """The last phase of a fit; None where one is missing, or its kind of field is not known here."""
    kind = fit_specs().get(next(iter(run.values())).field)
    return run[kind.phases[-1]] if kind and set(kind.phases) <= set(run) else None


def measures(run: Run, end: Record[FitResult] | None) -> list[float | None]:
    """What is measured of a fit after its last phase; minutes of all phases."""
    if end is None:
        return [None] * len(MEASURES)
    minutes = sum(part.result.fit_seconds for part in run.values()) / 60
    result = end.result
    quality = [result.train_psnr, result.train_ssim, result.psnr, result.ssim]
    return [*quality, minutes, result.primitives]


def is_alike_in(sweep: str, end: Record[FitResult]) -> bool:
    """Whether a fit is what the paper's number of its variant is of."""
    number = int(end.variant) if end.variant.isdigit() else 0
    return is_alike(end, views=number) if sweep == "views" else is_alike(end, pixels=number)


def theirs(key: Key, line: Line) -> Row:
    """A row of the paper's own."""
    dataset, variant = key
    scenes = numbers(paper("datasets")[dataset,], "basic_scenes")
    return Row([dataset, THEIRS, variant, *scenes, *numbers(line, *KEYS), *[None] * len(KEYS)], [])
