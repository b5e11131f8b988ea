"""Table `looks`: scenes with a new look, by pictures and by words, beside the paper's two tables of them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from statistics import fmean
from typing import Any

from texgs.report.metrics_files import Record, of, paper
from texgs.report.results import EditMeasures, EditResult
from texgs.report.table import Cell, Column, Row, Table

MEASURED = (
    "similarity",
    "direction",
    "frame_mean_ms",
    "frame_max_ms",
    "megabytes",
    "primitives",
    "style_nnfm",
    "style_gram",
    "short_rmse",
    "long_rmse",
    "short_lpips",
    "long_lpips",
)
COLUMNS = (
    Column("data set"),
    Column("recipe"),
    Column("edit"),
    Column("method"),
    Column("follows"),
    Column("lambda_s", 2, "-"),
    Column("minutes", 2),
    Column("CLIP similarity", 3),
    Column("CLIP direction", 3),
    Column("mean ms", 2),
    Column("max ms", 2),
    Column("MB", 1),
    Column("primitives", 0),
    Column("NNFM", 3),
    Column("Gram", 3),
    Column("RMSE, near", 4),
    Column("RMSE, far", 4),
    Column("LPIPS, near", 4),
    Column("LPIPS, far", 4),
    Column("geometry kept"),
)
PAPER = {  # its tables, by what a method follows
    "style": ("image_npse", "image-driven, 800x800"),
    "instruction": ("text_npse", "text-driven, 512x512"),
}
PUBLISHED = {  # columns of the paper's files by our own
    "minutes": "editing_min",
    "CLIP similarity": "clip_similarity",
    "CLIP direction": "clip_directional_similarity",
    "mean ms": "render_mean_ms",
    "max ms": "render_max_ms",
    "MB": "model_mb",
    "primitives": "primitives",
}


def looks(records: Iterable[Record[Any]]) -> Table:
    """The table of all edits among some jobs: by pictures, by words, and others; without any it is empty."""
    records = list(records)
    measures = {(each.dataset, each.label, each.result.edit): each for each in of(EditMeasures, records)}
    edits = {(each.dataset, each.label, each.result.edit): each for each in of(EditResult, records)}
    rows = []
    for follows in (*PAPER, ""):
        group = {key: edit for key, edit in sorted(edits.items()) if edit.result.follows == follows}
        own = [row_of(key, edit, measures.get(key)) for key, edit in group.items()]
        rows += [*own, *means(own), *(published(follows) if own and follows else [])]
    return Table(caption([each.result for each in measures.values()]), COLUMNS, rows)


def row_of(key: tuple[str, str, str], edit: Record[EditResult], measured: Record[EditMeasures] | None) -> Row:
    """One edit of one scene."""
    result, sources = edit.result, [edit.path]
    own: list[Cell] = [*key, result.how, words_of(result.followed), result.lambda_s, result.edit_seconds / 60]
    cells: list[Cell] = [None] * (len(MEASURED) + 1)
    if measured is not None:
        kept = "bit for bit" if measured.result.geometry_kept else "no"
        cells = [*(getattr(measured.result, name) for name in MEASURED), kept]
        sources.append(measured.path)
    return Row([*own, *cells], sources)


def words_of(followed: Mapping[str, str]) -> str:
    """The picture or the words of an edit, once where all models follow the same."""
    if len(set(followed.values())) == 1:
        return next(iter(followed.values()))
    return ", ".join(f"{name}: {value}" for name, value in followed.items()) or "-"


def means(rows: Sequence[Row]) -> list[Row]:
    """Mean rows of edits that several data sets have, as the paper's; of what was measured of all of them."""
    by_edit: dict[tuple[Cell, ...], list[Row]] = defaultdict(list)
    for row in rows:
        by_edit[tuple(row.cells[1:4])].append(row)
    made = []
    for key, group in by_edit.items():
        if len(group) > 1:
            cells: list[Cell] = [f"mean of {len(group)}", *key, "-"]
            for column in list(zip(*(row.cells for row in group), strict=True))[len(cells) :]:
                numbers = [cell for cell in column if isinstance(cell, int | float)]
                same = column[0] if len(set(column)) == 1 else None
                cells.append(fmean(numbers) if len(numbers) == len(group) else same)
            made.append(Row(cells, [path for row in group for path in row.sources]))
    return made


def published(follows: str) -> list[Row]:
    """Rows of the paper, means over four data sets each."""
    table, size = PAPER[follows]
    rows = []
    for (method, *_), line in paper(table).items():
        cells: list[Cell] = [None] * len(COLUMNS)
        cells[:5] = ["the paper", "-", size, method, "-"]
        for place, column in enumerate(COLUMNS):
            value = line.get(PUBLISHED.get(column.title, ""))
            cells[place] = float(value) if value else cells[place]
        rows.append(Row(cells, []))
    return rows


def caption(measured: Sequence[EditMeasures]) -> str:
    """What the columns are, which CLIP it was, and why it was not."""
    notes = {each.clip_missing for each in measured} - {None}
    backbones = {each.clip for each in measured} - {None}
    words = [
        "Minutes of the edit alone; frames along the test path; NNFM and Gram distance to the style in views "
        "that it was not learned from; RMSE and LPIPS between lit views, warped into each other by the depth "
        "of the first recipe's scene as fitted.",
        "The paper: means over four data sets, on an RTX 4090; it names neither its pictures nor its "
        "instructions, and those that `follows` tells stand in for them.",
    ]
    words += [f"CLIP: {name}." for name in sorted(map(str, backbones))]
    words += [f"CLIP not measured: {note}." for note in sorted(map(str, notes))]
    return " ".join(words)
