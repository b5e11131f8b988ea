"""Tables of fits: `fitting`, `fits`, `views`, `resolution`, `model_size` and `meshes`."""

from collections.abc import Iterable
from typing import Any

from texgs.fitting.kinds import fit_specs
from texgs.report.metrics_files import Record, of
from texgs.report.published import DATA, LABEL, beside_paper, cells, in_order, is_alike, rank
from texgs.report.results import FitResult, MeshResult
from texgs.report.table import SOURCES, UNPUBLISHED_CELL, Column, Table, columns

Run = dict[str, Record[FitResult]]  # a fit by its phases
OBJECT_PSNR = Column("PSNR on the object", 2)
SHOWN_SHARE = Column("share shown", 4)
RELIT_PSNR = Column("PSNR under unseen lights", 2, UNPUBLISHED_CELL)  # after the last phase
VARIANTS = {  # heading of the variants of each sweep, and the heading in the paper's file
    "views": ("training views", "views"),
    "resolution": ("pixels", "image_px"),
}


def phase_rows(records: Iterable[Record[Any]]) -> list[dict[str, Any]]:
    """Return the phases of fits outside of sweeps, by data set, label and order; unknown ones last."""
    phases = [phase for kind in fit_specs().values() for phase in kind.phases]
    order = {phase: place for place, phase in enumerate(phases)}
    unswept = [record for record in of(FitResult, records) if not record.is_swept]
    unswept.sort(key=lambda each: (rank(each), each.label, order.get(each.stage, len(order))))
    rows = []
    for record in unswept:
        result, gpu = record.result, record.result.peak_gpu_memory_mib
        numbers = {
            "PSNR": result.psnr,
            OBJECT_PSNR.title: result.object_psnr,
            SHOWN_SHARE.title: result.shown,
            "SSIM": result.ssim,
            "minutes": result.fit_seconds / 60,
            "CPU GiB": record.facts["peak_memory_mib"] / 1024,
            "GPU GiB": None if gpu is None else gpu / 1024,
            "primitives": result.primitives,
            RELIT_PSNR.title: result.relit_psnr,
        }
        rows.append(cells(record, phase=record.stage, alike=is_alike(record), **numbers))
    return rows


def fitting(records: Iterable[Record[Any]]) -> Table:
    """Return the table of all phases of fits: means over the basic scenes of a data set."""
    return beside_paper(phase_rows(records), "fitting", {"phase": "phase"}, columns("fitting"))


def fits(records: Iterable[Record[Any]]) -> Table:
    """Return the table of all phases of fits, each basic TF by itself."""
    rows = sorted(phase_rows(records), key=lambda row: (row["rank"], row["TF"] or ""))
    labels = [Column(title) for title in (DATA, "TF", LABEL, "phase")]
    psnr, *others = columns("fitting").values()
    caption = (
        "Test views, on the object where view or model show something. The share shown is that of what views "
        "show, by alpha, where the model is half as opaque at least: below 0.995 parts are missing. "
        "Minutes of the phase itself."
    )
    return Table(caption, [*labels, OBJECT_PSNR, psnr, SHOWN_SHARE, RELIT_PSNR, *others], rows)


def runs_of(records: Iterable[Record[Any]]) -> list[Run]:
    """Return fits by their phases, each basic TF of each variant and seed by itself."""
    runs: dict[tuple[str, str | None, str], Run] = {}
    for record in of(FitResult, records):
        runs.setdefault((record.dataset, record.tf, record.label), {})[record.stage] = record
    return list(runs.values())


def end_of(run: Run) -> Record[FitResult] | None:
    """Return the last phase of a fit, or None if a phase is missing or the kind of field is unknown."""
    return next((run[kind.phases[-1]] for kind in fit_specs().values() if set(kind.phases) <= set(run)), None)


def measures_of(run: Run) -> dict[str, Any]:
    """Return the measures of a fit after its last phase, with the minutes of all phases, by title."""
    if (end := end_of(run)) is None:
        return {}
    result = end.result
    return {
        "PSNR, training": result.train_psnr,
        "SSIM, training": result.train_ssim,
        "PSNR": result.psnr,
        "SSIM": result.ssim,
        RELIT_PSNR.title: result.relit_psnr,
        "minutes": sum(part.result.fit_seconds for part in run.values()) / 60,
        "memory GiB": max(part.facts["peak_memory_mib"] for part in run.values()) / 1024,
        "primitives": result.primitives,
    }


def ablation(records: Iterable[Record[Any]], sweep: str) -> Table:
    """Return the table of one of `VARIANTS`, including sweeps with that prefix, such as `views_quick`."""
    variant, heading = VARIANTS[sweep]
    own = [each for each in records if each.sweep == sweep or each.sweep.startswith(f"{sweep}_")]
    rows = []
    for run in runs_of(in_order([each for each in own if each.variant])):
        first, end = next(iter(run.values())), end_of(run)
        number = int(first.variant) if first.variant.isdigit() else 0
        expected = {"views": number} if sweep == "views" else {"pixels": number}
        row = cells(first, **measures_of(run), alike=end is not None and is_alike(end, **expected))
        row |= {LABEL: first.recipe, variant: first.variant, SOURCES: [part.path for part in run.values()]}
        rows.append(row)
    rows.sort(key=lambda row: (len(row[variant]), row[variant]))  # numbers, as words
    return beside_paper(rows, sweep, {heading: variant}, columns("views"))


def model_size(records: Iterable[Record[Any]]) -> Table:
    """Return the total sizes of a data set's models, counted as in the paper's appendix."""
    rows = []
    for record in in_order(of(FitResult, records)):
        if record.result.sizes and not record.is_swept:
            numbers = {**record.result.sizes, "primitives": record.result.primitives}
            sizes = {column.title: numbers[key] for key, column in columns("model_size").items()}
            rows.append(cells(record, alike=is_alike(record), **sizes))
    return beside_paper(rows, "model_size", {}, columns("model_size"), is_sum=True)


def meshes(records: Iterable[Record[Any]]) -> Table:
    """Return the table of surfaces of fits against isosurfaces of their volumes."""
    caption = (
        "Meshes fused from depth, against what training views see of the isosurface. Lengths in world units: "
        "the longest side of a volume is 1."
    )
    measured = columns("meshes")
    rows = [
        cells(record, **{column.title: getattr(record.result, key) for key, column in measured.items()})
        for record in in_order(each for each in of(MeshResult, records) if not each.is_swept)
    ]
    return Table(caption, [*map(Column, (DATA, "TF", LABEL)), *measured.values()], rows)
