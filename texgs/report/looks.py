"""Table `looks`: scenes with a new look, by pictures and by words, beside the paper's two tables of them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
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
    """The table of all edits among some jobs; without any it is empty."""
    records = list(records)
    measures = {(each.dataset, each.label, each.result.edit): each for each in of(EditMeasures, records)}
    edits = {(each.dataset, each.label, each.result.edit): each for each in of(EditResult, records)}
    rows = []
    for key, edit in sorted(edits.items()):
        own: list[Cell] = [*key, edit.result.how, edit.result.lambda_s, edit.result.edit_seconds / 60]
        measured, sources = measures.get(key), [edit.path]
        cells: list[Cell] = [None] * (len(MEASURED) + 1)
        if measured is not None:
            kept = "bit for bit" if measured.result.geometry_kept else "no"
            cells = [*(getattr(measured.result, name) for name in MEASURED), kept]
            sources.append(measured.path)
        rows.append(Row([*own, *cells], sources))
    words = caption([each.result for each in measures.values()])
    return Table(words, COLUMNS, rows + published() if rows else [])


def published() -> list[Row]:
    """Rows of the paper, means over four data sets each."""
    rows = []
    for table, size in (("image_npse", "image-driven, 800x800"), ("text_npse", "text-driven, 512x512")):
        for (method, *_), line in paper(table).items():
            cells: list[Cell] = [None] * len(COLUMNS)
            cells[:4] = ["the paper", "-", size, method]
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
        "that it was not learned from; RMSE and LPIPS between lit views, warped into each other by the depth of "
        "the first recipe's scene as fitted.",
        "The paper: means over four data sets, on an RTX 4090.",
    ]
    words += [f"CLIP: {name}." for name in sorted(map(str, backbones))]
    words += [f"CLIP not measured: {note}." for note in sorted(map(str, notes))]
    return " ".join(words)
