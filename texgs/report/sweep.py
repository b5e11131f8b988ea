"""The table of a sweep: means of each variant over all seeds, beside the paper's numbers."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from statistics import fmean, stdev
from typing import Any

from texgs.config.fields import kinds
from texgs.core.errors import ArgumentError
from texgs.report.metrics_files import fits, paper
from texgs.report.table import UNPUBLISHED, Cell, Column, Row, Table

MATERIAL = ("ambient_median", "diffuse_median", "specular_median", "shininess_median")
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
CAPTION = (
    "Test views after the last phase; means over seeds, ± their standard deviation; "
    "minutes of all phases; medians of the material."
)


def sweep(paths: Iterable[str | Path], name: str) -> Table:
    """The table of the variants among some metrics files.

    Args:
        paths: metrics files; those of other fits do not count.
        name: of the sweep; the paper's numbers stand beside those of its data set, where it has them.

    Raises:
        ArgumentError: if a file is no metrics file, or none is of the sweep.
    """
    groups: dict[tuple[str, ...], dict[int, dict[str, dict[str, Any]]]] = defaultdict(
        lambda: defaultdict(dict)
    )
    sources: dict[tuple[str, ...], list[Path]] = defaultdict(list)
    for path, metrics in fits(paths):
        if metrics.get("variant") and metrics["sweep"] == name:
            key = tuple(metrics[part] for part in ("dataset", "tf", "recipe", "variant"))
            sources[key].append(path)
            groups[key][metrics["seed"]][metrics["stage"]] = metrics
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


def cells(runs: Sequence[Mapping[str, Mapping[str, Any]]]) -> list[Cell]:
    """The cells of one variant from the metrics of its runs, by phase; None where a phase is missing."""
    whole = (kind.phases for kind in kinds().values() if any(set(kind.phases) <= set(run) for run in runs))
    phases = next(whole, ("none",))
    last, complete = phases[-1], [run for run in runs if set(phases) <= set(run)]
    if not complete:
        return [0, *[None] * (len(COLUMNS) - 5)]

    def mean(stage: str, key: str) -> float | None:
        values = [run[stage]["numbers"].get(key) for run in complete if stage in run]
        return None if None in values or not values else fmean(values)

    psnr = [run[last]["numbers"].get("psnr") for run in complete]
    spread = stdev(psnr) if len(psnr) > 1 and None not in psnr else None
    minutes = [sum(phase["numbers"]["fit_seconds"] for phase in run.values()) / 60 for run in complete]
    memory = [max(phase["peak_memory_mib"] for phase in run.values()) / 1024 for run in complete]
    quality = [mean(last, "train_psnr"), mean(last, "psnr"), spread, mean(last, "ssim")]
    costs = [fmean(minutes), max(memory), mean(last, "primitives")]
    return [len(complete), *quality, *costs, *(mean("shading", key) for key in MATERIAL)]


def natural(name: str) -> tuple[float, str]:
    """Numbers in their order before words."""
    return (float(name), "") if name.isdigit() else (float("inf"), name)
