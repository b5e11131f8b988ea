"""The table of a sweep: means of each variant over all seeds, beside the paper's numbers."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from pathlib import Path
from statistics import fmean, stdev
from typing import Any

from texgs.config.fields import kinds
from texgs.core.errors import ArgumentError
from texgs.report.metrics_files import Record, of, paper
from texgs.report.results import FitResult
from texgs.report.table import UNPUBLISHED, Cell, Column, Row, Table

MATERIAL = ("ambient", "diffuse", "specular", "shininess")
PUBLISHED = {  # columns of the paper's numbers, by their headings in its files
    "train_psnr": Column("PSNR, training (paper)", 2, UNPUBLISHED),
    "test_psnr": Column("PSNR (paper)", 2, UNPUBLISHED),
    "test_ssim": Column("SSIM (paper)", 4, UNPUBLISHED),
    "fitting_min": Column("minutes (paper)", 2, UNPUBLISHED),
    "primitives": Column("primitives (paper)", 0, UNPUBLISHED),
}
COLUMNS = (
    Column("data set"),
    Column("TF"),
    Column("recipe"),
    Column("variant"),
    Column("seeds", 0),
    Column("PSNR, training", 2),
    Column("PSNR", 2),
    Column("± PSNR", 2),
    Column("SSIM", 4),
    Column("minutes", 2),
    Column("memory GiB", 2),
    Column("primitives", 0),
    *(Column(title, 2) for title in ("k_a", "k_d", "k_s", "beta")),
)
Run = dict[str, Record[FitResult]]  # by phase
CAPTION = (
    "Test views after the last phase; means over seeds, ± their standard deviation; "
    "minutes of all phases; medians of the material."
)


def sweep(records: Iterable[Record[Any]], name: str) -> Table:
    """The table of the variants among some jobs.

    Args:
        records: jobs; those of other fits do not count.
        name: of the sweep; the paper's numbers stand beside those of its data set, where it has them.

    Raises:
        ArgumentError: if none is of the sweep.
    """
    groups: dict[tuple[str, ...], dict[int, Run]] = defaultdict(lambda: defaultdict(dict))
    sources: dict[tuple[str, ...], list[Path]] = defaultdict(list)
    for record in of(FitResult, records):
        if record.variant and record.sweep == name:
            key: tuple[str, ...] = (record.dataset, str(record.tf), record.facts["recipe"], record.variant)
            sources[key].append(record.path)
            groups[key][record.seed][record.stage] = record
    if not groups:
        raise ArgumentError(f"sweep {name}: no fit of it among the metrics files; run it first")
    published = paper(name, keys=2)
    lines = [
        published[dataset, variant] for dataset, _, _, variant in groups if (dataset, variant) in published
    ]
    beside = [PUBLISHED[key] for key in PUBLISHED if any(key in line for line in lines)]
    rows = []
    for key, by_seed in sorted(groups.items(), key=lambda item: (*item[0][:3], natural(item[0][3]))):
        line = published.get((key[0], key[3]), {})
        theirs = [float(line[k]) if line.get(k) else None for k, c in PUBLISHED.items() if c in beside]
        rows.append(Row([*key, *cells(list(by_seed.values())), *theirs], sources[key]))
    return Table(CAPTION, (*COLUMNS, *beside), rows)


def cells(runs: Sequence[Run]) -> list[Cell]:
    """The cells of one variant from its runs; None where a phase is missing."""
    whole = (kind.phases for kind in kinds().values() if any(set(kind.phases) <= set(run) for run in runs))
    phases = next(whole, None)
    if phases is None:
        return [0, *[None] * (len(COLUMNS) - 5)]
    complete = [run for run in runs if set(phases) <= set(run)]
    last = [run[phases[-1]].result for run in complete]
    psnr = [result.psnr for result in last if result.psnr is not None]
    spread = stdev(psnr) if 1 < len(psnr) == len(last) else None
    minutes = [sum(phase.result.fit_seconds for phase in run.values()) / 60 for run in complete]
    memory = [max(phase.facts["peak_memory_mib"] for phase in run.values()) / 1024 for run in complete]
    quality = [mean([x.train_psnr for x in last]), mean([x.psnr for x in last]), spread]
    costs = [fmean(minutes), max(memory), mean([x.primitives for x in last])]
    materials = [run["shading"].result.material for run in complete if "shading" in run]
    factors = [mean([material.get(name) for material in materials]) for name in MATERIAL]
    return [len(complete), *quality, mean([x.ssim for x in last]), *costs, *factors]


def mean(values: Sequence[float | None]) -> float | None:
    """The mean; None where a value is missing, or there is none."""
    known = [value for value in values if value is not None]
    return fmean(known) if known and len(known) == len(values) else None


def natural(name: str) -> tuple[float, str]:
    """Numbers in their order before words."""
    return (float(name), "") if name.isdigit() else (float("inf"), name)
