"""Tables of edits: `image_driven`, `text_driven` and `text_driven_frozen` as in the paper, and `looks`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from texgs.fields.kinds import kinds
from texgs.metrics.metric import Measure, metrics
from texgs.report.metrics_files import Record, of
from texgs.report.published import DATA, LABEL, THEIRS, cells, in_order, mean_rows, paper
from texgs.report.results import EditMeasures, EditResult
from texgs.report.table import SOURCES, UNPUBLISHED, Column, Table

MINUTES = Measure("minutes", "minutes", 2, "down", "editing_min")
LABELS = (*map(Column, (DATA, LABEL, "edit", "method")), Column("pixels", None, UNPUBLISHED))
PAPER = {  # its tables and their images, by what edits follow
    "style": ("image_npse", "800x800"),
    "instruction": ("text_npse", "512x512"),
}
CONSISTENCY = (
    "RMSE and LPIPS are between lit views, warped into each other by the depth of the first recipe's scene "
    "as fitted."
)
CAPTION = (
    "Sizes are those of the paper's tables of edits, with 100 bytes for each surfel beside its texels. "
    f"{CONSISTENCY} Mean rows count no stand-ins."
)
NOT_ALIKE = (
    "The paper's rows are means over four data sets on an RTX 4090. It publishes neither its pictures nor "
    "its instructions nor its transfer functions, so they stand by themselves."
)
FOLLOWED = ("style", "instruction", "")  # what edits follow, in the order of the table of all edits
Edit = Record[EditResult]
Rows = list[dict[str, Any]]


def measures(is_paper: bool = False, without: str = "") -> list[Measure]:
    """Return what is measured of edits, in the order of columns; all, or what the paper's tables have."""
    listed = [
        (metric.order, measure)
        for metric in metrics().values()
        if metric.name != without and (metric.is_in_paper or not is_paper)
        for measure in metric.measures
    ]
    return [measure for _, measure in sorted([*listed, (20, MINUTES)], key=lambda each: each[0])]


def image_driven(records: Iterable[Record[Any]]) -> Table:
    """Return the table of all edits by pictures, of which the paper measures no CLIP scores."""
    rows = [row for row in rows_of(records) if row["kind"] == "style"]
    return table("style", rows, measures(is_paper=True, without="clip"))


def text_driven(records: Iterable[Record[Any]]) -> Table:
    """Return the table of all edits by instructions, but for other methods with frozen geometry."""
    rows = [row for row in rows_of(records) if row["kind"] == "instruction"]
    free = [row for row in rows if row["has_texture"] or not row["is_kept"]]
    return table("instruction", free, measures(is_paper=True))


def text_driven_frozen(records: Iterable[Record[Any]]) -> Table:
    """Return all edits by instructions that keep geometry; none where only those do that always do."""
    rows = [row for row in rows_of(records) if row["kind"] == "instruction"]
    kept = [row for row in rows if row["has_texture"] or row["is_kept"]]
    is_chosen = not all(row["has_texture"] for row in kept)
    return table("", kept if is_chosen else [], measures(is_paper=True))


def looks(records: Iterable[Record[Any]]) -> Table:
    """Return the table of all measures of all edits: by pictures, by words, and others."""
    caption = (
        "Minutes of the edit alone; frames spread over the test path; NNFM and Gram distance to the style in "
        f"views that it was not learned from. {CONSISTENCY}"
    )
    rows = sorted(rows_of(records), key=lambda row: FOLLOWED.index(row["kind"]))
    labels = [*LABELS[:4], Column("follows"), Column("lambda_s", 2, "-")]
    columns = [Column(measure.title, measure.digits) for measure in measures()]
    shown = [{**row, "method": row["how"]} for row in rows]
    return Table(" ".join([caption, *notes(rows)]), [*labels, *columns], shown)


def table(follows: str, rows: Rows, listed: Sequence[Measure]) -> Table:
    """Return rows of edits, their means, and the paper's rows of edits that follow the same."""
    titles = [measure.title for measure in listed]
    columns = [Column(measure.title, measure.digits) for measure in listed]
    means = mean_rows(rows, (LABEL, "edit", "method"), ["pixels", *titles])
    theirs = published(follows, listed) if rows and follows else []
    sentences = [CAPTION, NOT_ALIKE] if theirs else [CAPTION]
    if set(titles) >= {measure.title for measure in metrics()["clip"].measures}:
        sentences += notes(rows)
    return Table(" ".join(sentences), [*LABELS, *columns], [*rows, *means, *theirs])


def rows_of(records: Iterable[Record[Any]]) -> Rows:
    """Return a row for each edit that is of no sweep, in the order of tables."""
    return [row_of(*pair) for pair in pairs_of(in_order(each for each in records if not each.is_swept))]


def pairs_of(records: Sequence[Record[Any]]) -> list[tuple[Edit, Record[EditMeasures] | None]]:
    """Return each edit with what was measured of it."""

    def key(record: Record[Any]) -> tuple[str, str, str]:
        return record.dataset, record.label, record.result.edit

    measured = {key(each): each for each in of(EditMeasures, records)}
    return [(edit, measured.get(key(edit))) for edit in of(EditResult, records)]


def row_of(edit: Edit, measured: Record[EditMeasures] | None) -> dict[str, Any]:
    """Return the row of one edit of one scene, for all tables."""
    made, seen, field = edit.result, measured.result if measured else None, kinds().get(edit.field)
    names = cells(edit, edit=made.edit, method=made.method, how=made.how, counts=not edit.stand_in)
    return names | {
        "kind": made.follows,
        "follows": words_of(made.followed),
        "lambda_s": made.lambda_s,
        "pixels": f"{seen.width}x{seen.height}" if seen and seen.width else None,
        "has_texture": field is not None and "texture" in field.can,  # geometry may stay anyway
        "is_kept": seen is not None and bool(seen.values.get("geometry_kept")),
        "values": seen.values if seen else {},
        **measured_cells(measures(), edit, measured),
    }


def measured_cells(
    listed: Iterable[Measure], edit: Edit, measured: Record[EditMeasures] | None
) -> dict[str, Any]:
    """Return minutes and measures of an edit by the titles of columns, as tables say them, and its files."""
    values = {"minutes": edit.result.edit_seconds / 60, **(measured.result.values if measured else {})}
    cells = {measure.title: (measure.words or {}, values.get(measure.name)) for measure in listed}
    files = [edit.path, measured.path] if measured else [edit.path]
    return {title: words.get(value, value) for title, (words, value) in cells.items()} | {SOURCES: files}


def words_of(followed: Mapping[str, str]) -> str:
    """Return the picture or the words of an edit, once where all models follow the same."""
    if len(set(followed.values())) == 1:
        return next(iter(followed.values()))
    return ", ".join(f"{name}: {value}" for name, value in followed.items()) or "-"


def published(follows: str, listed: Sequence[Measure]) -> list[dict[str, Any]]:
    """Return rows of the paper, means over four data sets each."""
    name, pixels = PAPER[follows]
    numbers = {measure.published: measure.title for measure in listed if measure.published}
    lines = paper(name, {"method": "method"}, numbers)
    lines = lines.astype(object).where(lines.notna(), UNPUBLISHED)
    blank = dict.fromkeys([measure.title for measure in listed], UNPUBLISHED)
    labels = {DATA: "mean of 4", LABEL: THEIRS, "edit": UNPUBLISHED, "pixels": pixels}
    return [{**blank, **labels, **line} for line in lines.to_dict("records")]


def notes(rows: Rows) -> list[str]:
    """Return what metrics say beside their numbers, such as which CLIP it was, and why it was not."""
    return [
        sentence.format(value)
        for metric in metrics().values()
        for key, sentence in (metric.notes or {}).items()
        for value in sorted({row["values"][key] for row in rows if row["values"].get(key)})
    ]
