"""Tables `fitting`, quality, time, memory and primitives after each phase, and `fits`, of each basic TF."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from texgs.report.means import mean
from texgs.report.metrics_files import Record, of, paper, phases
from texgs.report.published import (
    ALIKE,
    THEIRS,
    Key,
    Line,
    Ours,
    beside,
    is_alike,
    numbers,
    place_of,
    side_by_side,
)
from texgs.report.results import FitResult
from texgs.report.table import UNPUBLISHED, Cell, Column, Row, Table

MEASURES = (
    Column("PSNR", 2),
    Column("SSIM", 4),
    Column("minutes", 2),
    Column("CPU GiB", 2),
    Column("GPU GiB", 2, UNPUBLISHED),
    Column("primitives", 0),
)
LABELS = (Column("data set"), Column("recipe"), Column("phase"))
CAPTION = "Test views; minutes of the phase itself."
KEYS = ("psnr", "ssim", "minutes", "cpu_gb", "gpu_gb", "primitives")
COLUMNS = (
    *LABELS,
    Column("basic scenes", 0),
    *MEASURES,
    *(Column(f"{column.title} (paper)", column.digits, UNPUBLISHED) for column in MEASURES),
)


def fitting(records: Iterable[Record[Any]]) -> Table:
    """The table of all phases of fits among some jobs: means over the basic scenes of a data set."""
    published = paper("fitting", keys=2)
    groups: dict[tuple[str, str, str], list[Record[FitResult]]] = defaultdict(list)
    for record in in_phases(records):
        groups[record.title, record.label, record.stage].append(record)
    ours = [row_of(group, published) for group in groups.values()]
    return Table(ALIKE, COLUMNS, side_by_side(ours, published, theirs))


def in_phases(records: Iterable[Record[Any]]) -> list[Record[FitResult]]:
    """The phases of fits that are of no sweep, by data set, label and their order; unknown ones last."""
    order = {phase: place for place, phase in enumerate(phases())}
    unswept = [record for record in of(FitResult, records) if not record.is_swept]
    return sorted(unswept, key=lambda each: (place_of(each), each.label, order.get(each.stage, len(order))))


def row_of(parts: Sequence[Record[FitResult]], published: Mapping[Key, Line]) -> Ours:
    """One phase of the fits of a data set."""
    first, alike = parts[0], all(map(is_alike, parts))
    key = (first.dataset, first.stage)
    measured = [mean(column) for column in zip(*map(measures, parts), strict=True)]
    line = None if first.stand_in else published.get(key)
    cells: list[Cell] = [first.title, first.label, first.stage, len(parts), *measured]
    row = Row([*cells, *beside(line, KEYS, alike)], [part.path for part in parts])
    return Ours(row, first, key, alike)


def theirs(key: Key, line: Line) -> Row:
    """A row of the paper's own."""
    dataset, phase = key
    scenes = numbers(paper("datasets")[dataset,], "basic_scenes")
    return Row([dataset, THEIRS, phase, *scenes, *numbers(line, *KEYS), *[None] * len(KEYS)], [])


def measures(record: Record[FitResult]) -> list[float | None]:
    """What is measured of one phase of one basic scene, memory in GiB."""
    result, gpu = record.result, record.result.peak_gpu_memory_mib
    memory = [record.facts["peak_memory_mib"] / 1024, None if gpu is None else gpu / 1024]
    return [result.psnr, result.ssim, result.fit_seconds / 60, *memory, result.primitives]


def fits(records: Iterable[Record[Any]]) -> Table:
    """The table of all phases of fits among some jobs, each basic TF by itself."""
    columns = (Column("data set"), Column("TF"), *LABELS[1:], *MEASURES)
    ordered = sorted(in_phases(records), key=lambda each: (place_of(each), each.tf or ""))
    rows = [
        Row([each.title, each.tf, each.label, each.stage, *measures(each)], [each.path]) for each in ordered
    ]
    return Table(CAPTION, columns, rows)
