"""Tables of whole scenes: `model_size`, `rendering` and `edits`."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from texgs.report.means import mean_rows
from texgs.report.metrics_files import Record, of, paper
from texgs.report.published import (
    ALIKE,
    THEIRS,
    Key,
    Line,
    Ours,
    beside,
    images,
    in_order,
    is_alike,
    meant,
    numbers,
    side_by_side,
)
from texgs.report.results import FitResult, PseResult, TimingResult
from texgs.report.table import UNPUBLISHED, Cell, Column, Row, Table

SIZES = ("geometry_mib", "shading_mib", "texture_mib")
SIZE_COLUMNS = tuple(Column(title, 1) for title in ("geometry MiB", "shading MiB", "texture MiB"))
RENDERING = (
    Column("data set"),
    Column("recipe"),
    Column("pixels"),
    Column("device"),
    Column("threads", 0, UNPUBLISHED),
    Column("primitives", 0),
    Column("mean ms", 2),
    Column("max ms", 2),
    Column("volume, mean ms", 1),
    Column("volume / scene", 1),
    Column("volume, ms (paper)", 1, UNPUBLISHED),
)


def model_size(records: Iterable[Record[Any]]) -> Table:
    """Sizes of the models of a data set together, as the paper's appendix counts them."""
    published = paper("model_size")
    by_recipe: dict[tuple[str, str], list[Record[FitResult]]] = defaultdict(list)
    for record in in_order(of(FitResult, records)):
        if record.result.sizes and not record.is_swept:
            by_recipe[record.title, record.label].append(record)
    columns = (
        Column("data set"),
        Column("recipe"),
        Column("basic scenes", 0),
        *SIZE_COLUMNS,
        Column("primitives", 0),
        *(Column(f"{column.title} (paper)", column.digits, UNPUBLISHED) for column in SIZE_COLUMNS),
        Column("primitives (paper)", 0, UNPUBLISHED),
    )
    ours = [size_of(parts, published) for parts in by_recipe.values()]
    return Table(ALIKE, columns, side_by_side(ours, published, published_size))


def size_of(parts: Sequence[Record[FitResult]], published: Mapping[Key, Line]) -> Ours:
    """The models of a data set."""
    first = parts[0]
    line = None if first.stand_in else published.get((first.dataset,))
    sums = [sum(part.result.sizes[group] for part in parts) for group in SIZES]
    alike = all(map(is_alike, parts)) and line is not None and int(line["basic_scenes"]) == len(parts)
    primitives = sum(part.result.primitives for part in parts)
    cells: list[Cell] = [first.title, first.label, len(parts), *sums, primitives]
    row = Row([*cells, *beside(line, (*SIZES, "primitives"), alike)], [part.path for part in parts])
    return Ours(row, first, (first.dataset,), alike)


def published_size(key: Key, line: Line) -> Row:
    """A row of the paper's own."""
    return Row([*key, THEIRS, *numbers(line, "basic_scenes", *SIZES, "primitives"), *[None] * 4], [])


def rendering(records: Iterable[Record[Any]]) -> Table:
    """Time of frames of whole scenes, and of their volumes in the same job."""
    timings = [record for record in in_order(of(TimingResult, records)) if not record.is_swept]
    rows = {record.path: timing_of(record) for record in timings}
    means = mean_rows([rows[record.path] for record in timings if not record.stand_in], keys=5)
    theirs: list[Row] = []
    if any(meant(record) in images() for record in timings):
        theirs = [published_time("image", "800x800"), published_time("text", "512x512")]
    return Table("", RENDERING, [*rows.values(), *means, *theirs])


def timing_of(record: Record[TimingResult]) -> Row:
    """The frames of one scene."""
    frames, volume = record.result, record.result.volume_mean_ms
    where = [f"{frames.width}x{frames.height}", record.facts["device"], frames.threads, frames.primitives]
    ratio = None if volume is None else volume / frames.frame_mean_ms
    line = None if record.stand_in else paper("datasets").get((record.dataset,))
    alike = (frames.width, frames.height) == (images().get(record.dataset),) * 2
    times = [frames.frame_mean_ms, frames.frame_max_ms, volume, ratio]
    cells: list[Cell] = [record.title, record.label, *where, *times]
    return Row([*cells, *beside(line, ("dvr_ms",), alike)], [record.path])


def published_time(driven: str, pixels: str) -> Row:
    """The paper's times of its own scenes, from its table of edits by images or by texts."""
    line = paper(f"{driven}_npse")["TexGS-VolVis",]
    times = numbers(line, "primitives", "render_mean_ms", "render_max_ms")
    labels: list[Cell] = ["mean of 4", f"{THEIRS}, {driven}-driven", pixels, "RTX 4090", None]
    return Row([*labels, *times, *[UNPUBLISHED] * 3], [])


def edits(records: Iterable[Record[Any]]) -> Table:
    """Edited scenes against the volume with the same edits."""
    columns = (
        Column("data set"),
        Column("recipe"),
        Column("edit"),
        Column("views", 0),
        Column("PSNR", 2),
        Column("SSIM", 4),
    )
    rows = []
    for record in in_order(of(PseResult, records)):
        if record.is_swept:
            continue
        result = record.result
        for step in (*result.pse, *result.relight):
            cells: list[Cell] = [record.title, record.label, step.title, result.views, step.psnr, step.ssim]
            rows.append(Row(cells, [record.path]))
    return Table("", columns, rows)
