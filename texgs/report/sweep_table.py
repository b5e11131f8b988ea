"""The table of a sweep: means of each variant over all seeds."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from statistics import fmean, stdev
from typing import TYPE_CHECKING, Any

from texgs.core.errors import ArgumentError
from texgs.metrics.metric import Measure
from texgs.report.edit_tables import measured_cells, measures, pairs_of
from texgs.report.fit_tables import RELIT_PSNR, Run, measures_of, runs_of
from texgs.report.metrics_files import Record
from texgs.report.published import DATA, LABEL
from texgs.report.table import SOURCES, Column, Table, data_frame

if TYPE_CHECKING:
    from pandas import DataFrame

# Columns of measures of fits, with their digits.
FIT_DIGITS = {"PSNR, training": 2, "PSNR": 2, "SSIM": 4, "minutes": 2, "memory GiB": 2, "primitives": 0}
MATERIAL = {"k_a": "ambient", "k_d": "diffuse", "k_s": "specular", "beta": "shininess"}
SERIES = [DATA, "TF", LABEL, "edit"]  # subjects of variants; empty for runs without them
SEEDS = "Means over seeds, ± their standard deviation."
CAPTIONS = {  # by measure
    "PSNR": "Fits: test views after the last phase; minutes of all phases; medians of the material.",
    "NNFM": "Edits: minutes of the edit alone; distances to the style in views that it was not learned from.",
}


def sweep(records: Iterable[Record[Any]], name: str) -> Table:
    """Return the table of variants: a row for the fits of each, and one for each of its edits.

    Columns of names that all rows leave empty are left out.
    """
    runs = sweep_runs(records, name)
    table, titles = variants(runs), measured_titles(runs)
    spread = [title for title in titles if table[f"± {title}"].notna().any()]
    named = [title for title in [*SERIES, "variant"] if runs[title].any()]
    columns = [*map(Column, named), Column("seeds", 0)]
    for title, digits in titles.items():
        columns.append(Column(title, digits))
        if title in spread:
            columns.append(Column(f"± {title}", digits + (digits == 0)))
    words = [SEEDS] if spread else []
    words += [sentence for title, sentence in CAPTIONS.items() if title in titles]
    table[named] = table[named].replace("", "-")
    return Table(" ".join(words), columns, table)


def sweep_runs(records: Iterable[Record[Any]], name: str) -> DataFrame:
    """Return the runs of a sweep, each seed of each variant: fits, then edits, variants by number or name.

    A fit is one run with all its phases; one that misses a phase has no measures.
    """
    own = [record for record in records if record.variant and record.sweep == name]
    runs = [*map(fit_run, runs_of(own)), *edit_runs(own)]
    if not runs:
        raise ArgumentError(f"sweep {name}: no fit or edit of it among the metrics files; run it first")
    runs.sort(key=lambda run: natural(run["variant"]))
    runs.sort(key=lambda run: (run[DATA], bool(run["edit"]), *(run[key] for key in SERIES[1:])))
    numbers = [*FIT_DIGITS, RELIT_PSNR.title, *MATERIAL, *(measure.title for measure in edit_measures())]
    return data_frame(runs, [*SERIES, "variant", "series", "is_done", SOURCES, *dict.fromkeys(numbers)])


def fit_run(run: Run) -> dict[str, Any]:
    """Return the row of a fit with all its phases."""
    values, first = measures_of(run), next(iter(run.values()))
    material = run["shading"].result.material if "shading" in run and values else {}
    factors = {title: material.get(factor) for title, factor in MATERIAL.items()}
    sources = [phase.path for phase in run.values()]
    names = _names(first, str(first.tf), "")
    return {**names, "is_done": bool(values), SOURCES: sources, **values, **factors}


def edit_runs(records: Sequence[Record[Any]]) -> list[dict[str, Any]]:
    """Return the rows of edits, with measures for new looks."""
    return [
        {**_names(edit, "", edit.result.edit), "is_done": True, **measured_cells(edit_measures(), edit, seen)}
        for edit, seen in pairs_of(records)
    ]


def _names(record: Record[Any], tf: str, edit: str) -> dict[str, Any]:
    """Return the names of a run."""
    names = {DATA: record.dataset, "TF": tf, LABEL: record.recipe, "edit": edit}
    return {**names, "variant": record.variant, "series": " ".join(filter(None, names.values()))}


def edit_measures() -> list[Measure]:
    """Return the measures of edits that are numbers."""
    return [measure for measure in measures() if measure.digits is not None]


def measured_titles(runs: DataFrame) -> dict[str, int]:
    """Return the digits of measures of fits, if any, and of edits, by title."""
    relit = {RELIT_PSNR.title: 2} if runs[RELIT_PSNR.title].notna().any() else {}
    of_fits = {**FIT_DIGITS, **relit, **dict.fromkeys(MATERIAL, 2)} if (runs["edit"] == "").any() else {}
    of_edits = {measure.title: measure.digits or 0 for measure in edit_measures()}
    return of_fits | ({"minutes": 2, **of_edits} if runs["edit"].any() else {})


def variants(runs: DataFrame) -> DataFrame:
    """Return a row for each variant: means over finished seeds, and standard deviations.

    They are None where a value is missing, or there are too few.
    """
    rows = []
    for _, group in runs.groupby([*SERIES, "variant"], sort=False):
        done = group[group["is_done"].astype(bool)]
        row = {**group.iloc[0], "seeds": len(done), SOURCES: group[SOURCES].sum()}
        for title in measured_titles(runs):
            known = [] if done[title].isna().any() else done[title].tolist()
            row[title] = fmean(known) if known else None
            row[f"± {title}"] = stdev(known) if len(known) > 1 else None
        rows.append(row)
    return data_frame(rows)


def natural(name: str) -> tuple[float, str]:
    """Return the sort key of a variant: numbers in their order before words."""
    value = number(name)
    return (float("inf"), name) if value is None else (value, "")


def number(name: str) -> float | None:
    """Return the number in a variant's name, or None."""
    try:
        return float(name) if name[:1] in "-.0123456789" else None
    except ValueError:
        return None
