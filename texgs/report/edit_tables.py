"""Tables of edits: `image_driven`, `text_driven` and `text_driven_frozen` as in the paper, and `looks`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from texgs.fields.kinds import kinds
from texgs.metrics.metric import Measure, metrics
from texgs.report.metrics_files import Record, of
from texgs.report.published import DATA, LABEL, THEIRS, cells, in_order, mean_rows, paper
from texgs.report.results import EditMeasures, EditResult
from texgs.report.table import SOURCES, UNPUBLISHED, Column, Table, data_frame

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
Measures = Mapping[tuple[str, str, str], Record[EditMeasures]]  # by data set, label of the fit and edit


def measures(is_paper: bool = False, without: str = "") -> list[Measure]:
    """Return what is measured of edits, in the order of columns.

    Args:
        is_paper: whether only that of tables that are as in the paper.
        without: a metric to leave out.
    """
    listed = [
        (metric.order, measure)
        for metric in metrics().values()
        if metric.name != without and (metric.is_in_paper or not is_paper)
        for measure in metric.measures
    ]
    return [measure for _, measure in sorted([*listed, (20, MINUTES)], key=lambda each: each[0])]


def columns(listed: Iterable[Measure]) -> list[Column]:
    """Return the columns of measures."""
    return [Column(measure.title, measure.digits) for measure in listed]


def image_driven(records: Iterable[Record[Any]]) -> Table:
    """Return the table of all edits by pictures, of which the paper measures no CLIP scores."""
    measured = measures_of(records)
    return table("style", edits_of("style", records), measured, measures(is_paper=True, without="clip"))


def text_driven(records: Iterable[Record[Any]]) -> Table:
    """Return the table of all edits by instructions, but for other methods with frozen geometry."""
    measured = measures_of(records)
    edits = [each for each in edits_of("instruction", records) if not is_frozen_by_choice(each, measured)]
    return table("instruction", edits, measured, measures(is_paper=True))


def text_driven_frozen(records: Iterable[Record[Any]]) -> Table:
    """Return all edits by instructions that keep geometry; none where only those do that always do."""
    measured, edits = measures_of(records), edits_of("instruction", records)
    frozen = [each for each in edits if is_frozen_by_choice(each, measured)]
    kept = [each for each in edits if each in frozen or has_texture(each)] if frozen else []
    return table("", kept, measured, measures(is_paper=True))


def looks(records: Iterable[Record[Any]]) -> Table:
    """Return the table of all measures of all edits: by pictures, by words, and others."""
    caption = (
        "Minutes of the edit alone; frames spread over the test path; NNFM and Gram distance to the style in "
        f"views that it was not learned from. {CONSISTENCY}"
    )
    measured = measures_of(records)
    edits = sorted(
        in_order([each for each in of(EditResult, records) if not each.is_swept]),
        key=lambda each: FOLLOWED.index(each.result.follows),
    )
    rows = [
        {
            **row_of(each, measured.get(key_of(each))),
            "method": each.result.how,
            "follows": words_of(each.result.followed),
            "lambda_s": each.result.lambda_s,
        }
        for each in edits
    ]
    labels = [*LABELS[:4], Column("follows"), Column("lambda_s", 2, "-")]
    sentences = notes([each.result for each in measured.values()])
    return Table(" ".join([caption, *sentences]), [*labels, *columns(measures())], rows)


def measures_of(records: Iterable[Record[Any]]) -> Measures:
    """Return what was measured of edits that are of no sweep."""
    return {key_of(each): each for each in of(EditMeasures, records) if not each.is_swept}


def edits_of(follows: str, records: Iterable[Record[Any]]) -> list[Edit]:
    """Return the edits that follow the same and are of no sweep, in the order of tables."""
    edits = in_order(of(EditResult, records))
    return [each for each in edits if each.result.follows == follows and not each.is_swept]


def table(follows: str, edits: Sequence[Edit], measured: Measures, listed: Sequence[Measure]) -> Table:
    """Return rows of edits, their means, and the paper's rows of edits that follow the same."""
    rows = [row_of(each, measured.get(key_of(each))) for each in edits]
    titles = [measure.title for measure in listed]
    means = mean_rows(data_frame(rows), (LABEL, "edit", "method"), ["pixels", *titles])
    theirs = published(follows, listed) if edits and follows else []
    sentences = [CAPTION, NOT_ALIKE] if theirs else [CAPTION]
    if set(titles) >= {measure.title for measure in metrics()["clip"].measures}:
        sentences += notes([measured[key_of(each)].result for each in edits if key_of(each) in measured])
    return Table(" ".join(sentences), [*LABELS, *columns(listed)], [*rows, *means, *theirs])


def key_of(record: Record[EditResult] | Record[EditMeasures]) -> tuple[str, str, str]:
    """Return what an edit and its measures have in common."""
    return record.dataset, record.label, record.result.edit


def has_texture(edit: Edit) -> bool:
    """Return whether looks change within the primitives of a field, so that its geometry may stay anyway."""
    kind = kinds().get(edit.field)
    return kind is not None and "texture" in kind.can


def is_frozen_by_choice(edit: Edit, measured: Measures) -> bool:
    """Return whether geometry stayed as it was although the field has no textures."""
    own = measured.get(key_of(edit))
    return own is not None and bool(own.result.values.get("geometry_kept")) and not has_texture(edit)


def row_of(edit: Edit, measured: Record[EditMeasures] | None) -> dict[str, Any]:
    """Return the row of one edit of one scene."""
    row = cells(edit, edit=edit.result.edit, method=edit.result.method, counts=not edit.stand_in)
    values, result = {"minutes": edit.result.edit_seconds / 60}, measured.result if measured else None
    if measured and result:
        values |= result.values
        row[SOURCES] = [edit.path, measured.path]
    row["pixels"] = f"{result.width}x{result.height}" if result and result.width else None
    return row | measured_cells(measures(), values)


def measured_cells(listed: Iterable[Measure], values: Mapping[str, Any]) -> dict[str, Any]:
    """Return values by the titles of their columns, as tables say them."""
    cells = {measure.title: (measure.words or {}, values.get(measure.name)) for measure in listed}
    return {title: words.get(value, value) for title, (words, value) in cells.items()}


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


def notes(measured: Sequence[EditMeasures]) -> list[str]:
    """Return what metrics say beside their numbers, such as which CLIP it was, and why it was not."""
    return [
        sentence.format(value)
        for metric in metrics().values()
        for key, sentence in (metric.notes or {}).items()
        for value in sorted({each.values[key] for each in measured if each.values.get(key)})
    ]
