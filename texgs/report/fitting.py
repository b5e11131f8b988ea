"""Table `fitting`: quality, time, memory and primitives after each phase, beside the paper's numbers."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from texgs.report.metrics_files import Record, of, paper, phases
from texgs.report.results import FitResult
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


def fitting(records: Iterable[Record[Any]]) -> Table:
    """The table of all phases of fits among some jobs."""
    published, order = paper("fitting", keys=2), phases()
    rows = [Row(cells(record, published), [record.path]) for record in of(FitResult, records)]
    rows.sort(key=lambda row: (row.cells[:3], order.index(str(row.cells[3]))))
    return Table(CAPTION, COLUMNS, rows)


def cells(record: Record[FitResult], published: dict[tuple[str, ...], dict[str, str]]) -> list[Cell]:
    """The cells of one job."""
    result, beside = record.result, published.get((record.dataset, record.stage), {})
    own = [result.psnr, result.ssim, result.fit_seconds / 60]
    own += [record.facts["peak_memory_mib"] / 1024, result.primitives]
    theirs = [float(beside[key]) if key in beside else None for key in ("psnr", "ssim", "minutes")]
    return [record.dataset, record.tf, record.label, record.stage, *own, *theirs]
