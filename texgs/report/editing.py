"""Tables `image_driven`, `text_driven` and `text_driven_frozen`: edits, with the paper's columns first."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

from texgs.fields.kinds import kinds
from texgs.report.means import mean_rows
from texgs.report.metrics_files import Record, of, paper
from texgs.report.published import THEIRS, in_order, numbers
from texgs.report.results import EditMeasures, EditResult
from texgs.report.table import UNPUBLISHED, Cell, Column, Row, Table

LABELS = (
    *(Column(title) for title in ("data set", "recipe", "edit", "method")),
    Column("pixels", None, UNPUBLISHED),
)
MEASURES = {  # columns by what is measured
    "similarity": Column("CLIP similarity", 3),
    "direction": Column("CLIP direction", 3),
    "minutes": Column("minutes", 2),
    "frame_mean_ms": Column("mean ms", 2),
    "frame_max_ms": Column("max ms", 2),
    "megabytes": Column("MB", 1),
    "primitives": Column("primitives", 0),
    "short_rmse": Column("RMSE, near", 4),
    "long_rmse": Column("RMSE, far", 4),
    "short_lpips": Column("LPIPS, near", 4),
    "long_lpips": Column("LPIPS, far", 4),
    "geometry_kept": Column("geometry kept"),
}
PUBLISHED = {  # headings of the paper's files by what is measured
    "similarity": "clip_similarity",
    "direction": "clip_directional_similarity",
    "minutes": "editing_min",
    "frame_mean_ms": "render_mean_ms",
    "frame_max_ms": "render_max_ms",
    "megabytes": "model_mb",
    "primitives": "primitives",
}
CLIP = ("similarity", "direction")  # the paper measures it of edits by texts
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
KEPT = {True: "bit for bit", False: "no"}
Edit = Record[EditResult]
Key = tuple[str, str, str]  # data set, label of the fit, edit
Measures = Mapping[Key, Record[EditMeasures]]


def image_driven(records: Iterable[Record[Any]]) -> Table:
    """The table of all edits by pictures among some jobs."""
    measured = measures_of(records)
    return table(
        "style", edits_of("style", records), measured, [name for name in MEASURES if name not in CLIP]
    )


def text_driven(records: Iterable[Record[Any]]) -> Table:
    """The table of all edits by instructions among some jobs, but for other methods with frozen geometry."""
    measured = measures_of(records)
    edits = [each for each in edits_of("instruction", records) if not is_frozen_by_choice(each, measured)]
    return table("instruction", edits, measured, list(MEASURES))


def text_driven_frozen(records: Iterable[Record[Any]]) -> Table:
    """The table of all edits by instructions that keep geometry; empty where only those do that always do."""
    measured, edits = measures_of(records), edits_of("instruction", records)
    frozen = [each for each in edits if is_frozen_by_choice(each, measured)]
    kept = [each for each in edits if each in frozen or has_texture(each)] if frozen else []
    return table("", kept, measured, list(MEASURES))


def measures_of(records: Iterable[Record[Any]]) -> Measures:
    """What was measured of edits."""
    return {key_of(each): each for each in of(EditMeasures, records)}


def edits_of(follows: str, records: Iterable[Record[Any]]) -> list[Edit]:
    """Edits by pictures or by instructions that are of no sweep."""
    edits = in_order(of(EditResult, records))
    return [each for each in edits if each.result.follows == follows and not each.is_swept]


def table(follows: str, edits: Sequence[Edit], measured: Measures, names: Sequence[str]) -> Table:
    """Rows of some edits, their means, and the paper's rows of edits that follow the same, if it has some."""
    rows = {each.path: row_of(each, measured.get(key_of(each)), names) for each in edits}
    means = mean_rows([rows[each.path] for each in edits if not each.stand_in], keys=4)
    theirs = published(follows, names) if edits and follows else []
    notes = [CAPTION, NOT_ALIKE] if theirs else [CAPTION]
    if set(CLIP) <= set(names):
        notes += clip_notes([measured[key_of(each)].result for each in edits if key_of(each) in measured])
    columns = (*LABELS, *(MEASURES[name] for name in names))
    return Table(" ".join(notes), columns, [*rows.values(), *means, *theirs])


def key_of(record: Record[EditResult] | Record[EditMeasures]) -> Key:
    """What an edit and its measures have in common."""
    return record.dataset, record.label, record.result.edit


def has_texture(edit: Edit) -> bool:
    """Whether looks change within the primitives of a field, so that its geometry may stay in any case."""
    kind = kinds().get(edit.field)
    return kind is not None and "texture" in kind.can


def is_frozen_by_choice(edit: Edit, measured: Measures) -> bool:
    """Whether geometry stayed as it was although the field has no textures."""
    its_own = measured.get(key_of(edit))
    return its_own is not None and its_own.result.geometry_kept and not has_texture(edit)


def row_of(edit: Edit, measured: Record[EditMeasures] | None, names: Sequence[str]) -> Row:
    """One edit of one scene."""
    result, values = edit.result, {"minutes": edit.result.edit_seconds / 60} | measures(measured)
    pixels = f"{values['width']}x{values['height']}" if values.get("width") else None
    labels: list[Cell] = [edit.title, edit.label, result.edit, result.method, pixels]
    sources = [edit.path, measured.path] if measured else [edit.path]
    return Row([*labels, *(values.get(name) for name in names)], sources)


def measures(measured: Record[EditMeasures] | None) -> dict[str, Any]:
    """What was measured of an edit, by name; nothing where nothing was."""
    if measured is None:
        return {}
    return asdict(measured.result) | {"geometry_kept": KEPT[measured.result.geometry_kept]}


def published(follows: str, names: Sequence[str]) -> list[Row]:
    """Rows of the paper, means over four data sets each."""
    name, pixels = PAPER[follows]
    rows = []
    for (method,), line in paper(name).items():
        values = dict(zip(PUBLISHED, numbers(line, *PUBLISHED.values()), strict=True))
        cells = [UNPUBLISHED if values.get(key) is None else values[key] for key in names]
        rows.append(Row(["mean of 4", THEIRS, UNPUBLISHED, method, pixels, *cells], []))
    return rows


def clip_notes(measured: Sequence[EditMeasures]) -> list[str]:
    """Which CLIP it was, and why it was not."""
    backbones = {each.clip for each in measured if each.clip}
    reasons = {each.clip_missing for each in measured if each.clip_missing}
    scores = [
        f"CLIP of the scores: {name}; that of a loss stands beside its method." for name in sorted(backbones)
    ]
    return [*scores, *(f"CLIP not measured: {reason}." for reason in sorted(reasons))]
