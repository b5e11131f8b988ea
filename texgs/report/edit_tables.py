"""Tables of edits: the paper's comparisons of edits with the key `compared`, and `looks` of all edits."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from texgs.fields.kinds import kinds
from texgs.metrics.metric import Measure, metrics
from texgs.models.pictures import PICTURES
from texgs.report import published
from texgs.report.metrics_files import Record, of
from texgs.report.published import DATA, LABEL, PAPER_LABEL, cells, in_order, mean_rows, paper, paper_file
from texgs.report.results import EditMeasures, EditResult
from texgs.report.table import SOURCES, UNPUBLISHED_CELL, Column, Table

MINUTES = Measure("minutes", "minutes", 2, "down", "editing_min")
LABELS = (*map(Column, (DATA, LABEL, "edit", "method")), Column("pixels", None, UNPUBLISHED_CELL))
PAPER = {  # the paper's tables and their image sizes, by what edits follow
    "style": ("image_npse", "800x800"),
    "instruction": ("text_npse", "512x512"),
}
CONSISTENCY = (
    "RMSE and LPIPS are between lit views, warped into each other by the depth of the first recipe's scene "
    "as fitted."
)
CAPTION = (
    "Sizes count 100 bytes for each surfel beside its texels, as the paper's tables do. "
    f"{CONSISTENCY} Mean rows count no stand-ins. Edits of no comparison are in the table of all edits."
)
ADAPTS = "adapts"  # method in mean rows over data sets with different methods
FOLLOW_ORDER = ("style", "instruction", "")  # what edits follow, in the order of the table of all edits
Edit = Record[EditResult]
Rows = list[dict[str, Any]]


def measures() -> list[Measure]:
    """Return the measures of edits, in column order."""
    listed = [(metric.order, measure) for metric in metrics().values() for measure in metric.measures]
    return [measure for _, measure in sorted([*listed, (20, MINUTES)], key=lambda each: each[0])]


def paper_measures(follows: str) -> list[Measure]:
    """Return the columns of one of the paper's tables in its order, then the unpublished ones."""
    by_heading = {measure.published: measure for measure in measures()}
    own = [by_heading[heading] for heading in paper_file(PAPER[follows][0]) if heading in by_heading]
    more = [each for metric in metrics().values() if metric.is_in_paper for each in metric.measures]
    return [*own, *(measure for measure in more if not measure.published)]


def image_driven(records: Iterable[Record[Any]]) -> Table:
    """Return the comparison of edits by pictures, for which the paper has no CLIP scores."""
    rows = compared_rows(records, "style")
    return comparison("style" if published.are_of_paper(records) else "", rows, paper_measures("style"))


def text_driven(records: Iterable[Record[Any]]) -> Table:
    """Return the comparison of edits by instructions, without other methods with frozen geometry."""
    rows = compared_rows(records, "instruction")
    free = [row for row in rows if row["has_texture"] or not row["is_kept"]]
    return comparison(
        "instruction" if published.are_of_paper(records) else "", free, paper_measures("instruction")
    )


def text_driven_frozen(records: Iterable[Record[Any]]) -> Table:
    """Return the comparison of edits that keep geometry; empty if only methods that always keep it do."""
    rows = compared_rows(records, "instruction")
    kept = [row for row in rows if row["has_texture"] or row["is_kept"]]
    is_chosen = not all(row["has_texture"] for row in kept)
    return comparison("", kept if is_chosen else [], paper_measures("instruction"))


def compared_rows(records: Iterable[Record[Any]], follows: str) -> Rows:
    """Return the rows of the edits of a comparison."""
    return [row for row in rows_of(records) if row["is_compared"] and row["kind"] == follows]


def looks(records: Iterable[Record[Any]]) -> Table:
    """Return the table of all measures of all edits: by pictures, by words, and others."""
    caption = (
        "Minutes of the edit alone; eight frames spread over the test path; NNFM and Gram distance to the "
        "style in views that it was not learned from; the place of its picture among the "
        f"{len(PICTURES)} of texgs, by how near views are to each, less the mean over the scene's looks, two "
        f"at least: 1 is the nearest. {CONSISTENCY} Told by hue is the share of pixels of one TF that the "
        "legend tells, mean over TFs; depth order that of edges whose lighter side is that of the volume."
    )
    rows = sorted(rows_of(records), key=lambda row: FOLLOW_ORDER.index(row["kind"]))
    labels = [*LABELS[:4], Column("follows"), Column("lambda_s", 2, "-")]
    columns = [Column(measure.title, measure.digits) for measure in measures()]
    own = notes(rows, [measure.title for measure in measures()])
    return Table(" ".join([caption, *own]), [*labels, *columns], rows)


def comparison(follows: str, rows: Rows, listed: Sequence[Measure]) -> Table:
    """Return rows of edits, means over edits of one size, and the paper's own rows."""
    titles = [measure.title for measure in listed]
    columns = [Column(measure.title, measure.digits) for measure in listed]
    means = mean_rows(rows, (LABEL, "edit", "pixels", "device"), ["method", *titles])
    means = [{**row, "method": row["method"] or ADAPTS} for row in means]
    theirs = paper_rows(follows, listed) if rows and follows else []
    return Table(" ".join([CAPTION, *notes(rows, titles)]), [*LABELS, *columns], [*rows, *means, *theirs])


def rows_of(records: Iterable[Record[Any]]) -> Rows:
    """Return a row for each edit outside of sweeps, in table order."""
    return [row_of(*pair) for pair in pairs_of(in_order(each for each in records if not each.is_swept))]


def pairs_of(records: Sequence[Record[Any]]) -> list[tuple[Edit, Record[EditMeasures] | None]]:
    """Return each edit with its measures, including those among the looks of its scene."""

    def key(record: Record[Any]) -> tuple[str, str, str]:
        return record.dataset, record.label, record.result.edit

    measured = {key(each): each for each in of(EditMeasures, records)}
    edits = of(EditResult, records)
    by_scene: dict[tuple[str, str], list[Edit]] = {}
    for edit in edits:
        if key(edit) in measured:
            by_scene.setdefault((edit.dataset, edit.label), []).append(edit)
    for own in by_scene.values():
        seen = [measured[key(edit)] for edit in own]
        pictures = [words_of(edit.result.followed) if edit.result.follows == "style" else "" for edit in own]
        listed = [(name, each.result.values) for name, each in zip(pictures, seen, strict=True)]
        for metric in metrics().values():
            more = metric.among(listed) if metric.among else []
            for index, values in enumerate(more):
                known = seen[index].result
                seen[index] = replace(seen[index], result=replace(known, values={**known.values, **values}))
        measured |= {key(edit): each for edit, each in zip(own, seen, strict=True)}
    return [(edit, measured.get(key(edit))) for edit in edits]


def row_of(edit: Edit, measured: Record[EditMeasures] | None) -> dict[str, Any]:
    """Return the row of one edit of one scene, for all tables."""
    made, seen, field = edit.result, measured.result if measured else None, kinds().get(edit.field)
    how = ", ".join(filter(None, [made.how, made.lifted]))
    names = cells(edit, edit=made.edit, method=f"{made.method}: {how}", kind=made.follows)
    return names | {
        "is_compared": made.is_compared,
        "counts": bool(seen and seen.width and not edit.stand_in),
        "follows": words_of(made.followed),
        "lambda_s": made.lambda_s,
        "device": edit.facts.get("device"),
        "pixels": f"{seen.width}x{seen.height}" if seen and seen.width else None,
        "has_texture": field is not None and "texture" in field.can,  # then geometry can stay
        "is_kept": seen is not None and bool(seen.values.get("geometry_kept")),
        "values": seen.values if seen else {},
        **measured_cells(measures(), edit, measured),
    }


def measured_cells(
    listed: Iterable[Measure], edit: Edit, measured: Record[EditMeasures] | None
) -> dict[str, Any]:
    """Return minutes and measures of an edit by column title, and its files."""
    values = {"minutes": edit.result.edit_seconds / 60, **(measured.result.values if measured else {})}
    cells = {measure.title: (measure.words or {}, values.get(measure.name)) for measure in listed}
    files = [edit.path, measured.path] if measured else [edit.path]
    return {title: words.get(value, value) for title, (words, value) in cells.items()} | {SOURCES: files}


def words_of(followed: Mapping[str, str]) -> str:
    """Return the picture or the words of an edit, once if all models follow the same."""
    if len(set(followed.values())) == 1:
        return next(iter(followed.values()))
    return ", ".join(f"{name}: {value}" for name, value in followed.items()) or "-"


def paper_rows(follows: str, listed: Sequence[Measure]) -> list[dict[str, Any]]:
    """Return rows of the paper, means over four data sets each."""
    name, pixels = PAPER[follows]
    numbers = {measure.published: measure.title for measure in listed if measure.published}
    lines = paper(name, {"method": "method"}, numbers)
    lines = lines.astype(object).where(lines.notna(), UNPUBLISHED_CELL)
    blank = dict.fromkeys([measure.title for measure in listed], UNPUBLISHED_CELL)
    labels = {DATA: "mean of 4", LABEL: PAPER_LABEL, "edit": UNPUBLISHED_CELL, "pixels": pixels}
    return [{**blank, **labels, **line} for line in lines.to_dict("records")]


def notes(rows: Rows, titles: Collection[str]) -> list[str]:
    """Return the notes of metrics with all columns in a table, such as the CLIP backbone."""
    return [
        sentence.format(value)
        for metric in metrics().values()
        if {measure.title for measure in metric.measures} <= set(titles)
        for key, sentence in (metric.notes or {}).items()
        for value in sorted({row["values"][key] for row in rows if row["values"].get(key)})
    ]
