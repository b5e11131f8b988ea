"""Table `fitting`: quality, time, memory and primitives after each phase, beside the paper's numbers."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from texgs.report.metrics_files import fits, paper, phases
from texgs.report.table import UNPUBLISHED, Cell, Column, Row, Table

COLUMNS = (
    Column("data set"),
    Column("TF"),
    Column("recipe"),
    Column("phase"),
    Column("PSNR", 2),
    Column("SSIM", 4),
    Column("minutes", 2),
    Column("memory GiB", 2),
    Column("primitives", 0),
    Column("PSNR (paper)", 2, UNPUBLISHED),
    Column("SSIM (paper)", 4, UNPUBLISHED),
    Column("minutes (paper)", 2, UNPUBLISHED),
)
CAPTION = "Test views; minutes of the phase itself. The paper: means over basic scenes, on an RTX 4090."


def fitting(paths: Iterable[str | Path]) -> Table:
    """The table of all jobs of the fit among some metrics files.

    Raises:
        ArgumentError: if a file is no metrics file.
    """
    published, order = paper("fitting", keys=2), phases()
    rows = [Row(cells(metrics, path.parts[-3], published), [path]) for path, metrics in fits(paths)]
    rows.sort(key=lambda row: (row.cells[:3], order.index(str(row.cells[3]))))
    return Table(CAPTION, COLUMNS, rows)


def cells(
    metrics: dict[str, Any], recipe: str, published: dict[tuple[str, ...], dict[str, str]]
) -> list[Cell]:
    """The cells of one job."""
    numbers, phase = metrics["numbers"], metrics["stage"]
    beside = published.get((metrics["dataset"], phase), {})
    own = [numbers.get("psnr"), numbers.get("ssim"), numbers["fit_seconds"] / 60]
    own += [metrics["peak_memory_mib"] / 1024, numbers["primitives"]]
    theirs = [float(beside[key]) if key in beside else None for key in ("psnr", "ssim", "minutes")]
    return [metrics["dataset"], metrics["tf"], recipe, phase, *own, *theirs]
