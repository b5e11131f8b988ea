"""Table `looks`: all that is measured of all edits, also of those that follow no picture and no words."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from texgs.report.editing import CONSISTENCY, MEASURES, clip_notes, key_of, measures
from texgs.report.metrics_files import Record, of
from texgs.report.published import in_order
from texgs.report.results import EditMeasures, EditResult
from texgs.report.table import Cell, Column, Row, Table

LABELS = (
    Column("data set"),
    Column("recipe"),
    Column("edit"),
    Column("method"),
    Column("follows"),
    Column("lambda_s", 2, "-"),
)
ALL = MEASURES | {"style_nnfm": Column("NNFM", 3), "style_gram": Column("Gram", 3)}
ORDER = ("style", "instruction", "")  # by what edits follow
CAPTION = (
    "Minutes of the edit alone; frames spread over the test path; NNFM and Gram distance to the style in "
    f"views that it was not learned from. {CONSISTENCY}"
)


def looks(records: Iterable[Record[Any]]) -> Table:
    """The table of all edits among some jobs: by pictures, by words, and others; without any it is empty."""
    records = [record for record in records if not record.is_swept]
    measured = {key_of(each): each for each in of(EditMeasures, records)}
    edits = sorted(in_order(of(EditResult, records)), key=lambda each: ORDER.index(each.result.follows))
    rows = [row_of(each, measured.get(key_of(each))) for each in edits]
    notes = clip_notes([each.result for each in measured.values()])
    return Table(" ".join([CAPTION, *notes]), (*LABELS, *ALL.values()), rows)


def row_of(edit: Record[EditResult], measured: Record[EditMeasures] | None) -> Row:
    """One edit of one scene."""
    result, values = edit.result, {"minutes": edit.result.edit_seconds / 60} | measures(measured)
    labels: list[Cell] = [edit.title, edit.label, result.edit, result.how, words_of(result.followed)]
    sources = [edit.path, measured.path] if measured else [edit.path]
    return Row([*labels, result.lambda_s, *(values.get(name) for name in ALL)], sources)


def words_of(followed: Mapping[str, str]) -> str:
    """The picture or the words of an edit, once where all models follow the same."""
    if len(set(followed.values())) == 1:
        return next(iter(followed.values()))
    return ", ".join(f"{name}: {value}" for name, value in followed.items()) or "-"
