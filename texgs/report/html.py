"""One HTML file with all that a run has to show: tables, pictures, curves, and where each came from."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

from texgs.core.io import write_bytes
from texgs.report.left_out import LeftOut, others
from texgs.report.losses import loss_figures
from texgs.report.metrics_files import Record, read_known
from texgs.report.sections import SECTIONS, Figure, figures
from texgs.report.table import Table
from texgs.report.tables import specs, sweeps_of, tables_of

JOB = ("stage", "dataset", "tf", "recipe", "edit", "variant", "seed", "seconds", "peak_memory_mib", "device")
SOURCE = ("config_sha", "code_sha", "git_sha", "run")
DRAWN = {"fitting": loss_figures}  # figures that no job has made, by section


@dataclass(frozen=True)
class Section:
    """A part of the report."""

    key: str
    title: str
    tables: dict[str, Table]  # by name
    figures: dict[str, list[Figure]]  # by data set


def write_report(
    path: str | Path, metrics_files: Iterable[str | Path], left_out: Sequence[LeftOut] = ()
) -> Path:
    """Write a report that needs no other file.

    Args:
        path: target, .html.
        metrics_files: of all jobs to report; their pictures lie beside them.
        left_out: what of the run is not there.

    Returns:
        The path.

    Raises:
        ArgumentError: if a file is no metrics file, all are of other versions of texgs, or the target cannot
            be written.
    """
    from jinja2 import Environment

    records, old = read_known(metrics_files)
    template = files("texgs.report").joinpath("report.html.j2").read_text(encoding="utf-8")
    environment = Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True)
    text = environment.from_string(template).render(
        sections=sections(records, left_out),
        left_out=[*left_out, *others(old)],
        jobs=[job(record.facts) for record in records],
        places={record.path: index for index, record in enumerate(records, start=1)},
        versions=versions([record.facts for record in records]),
        headings=(*JOB, *SOURCE),
        sources_from=len(JOB),
        kinds=kinds,
    )
    return write_bytes(path, text.encode())


def sections(records: Sequence[Record[Any]], left_out: Sequence[LeftOut]) -> list[Section]:
    """The sections that have something to show."""
    pictures, tables = figures(records), tables_of(records, left_out)
    places = {spec.name: spec.section for spec in specs(sweeps_of(records))}
    shown = []
    for key, title in SECTIONS.items():
        own = {name: table for name, table in tables.items() if table.rows and places[name] == key}
        drawn = DRAWN[key](records) if key in DRAWN else []
        by_dataset: dict[str, list[Figure]] = {}
        for figure in [*pictures[key], *drawn]:
            by_dataset.setdefault(figure.dataset, []).append(figure)
        if own or by_dataset:
            shown.append(Section(key, title, own, by_dataset))
    return shown


def job(metrics: Mapping[str, Any]) -> list[str]:
    """The cells of one job in the list of where things came from."""
    facts = {"edit": metrics["numbers"].get("edit"), **metrics}
    cells = [facts.get(key) for key in (*JOB, *SOURCE)]
    return ["" if x is None else f"{x:.1f}" if isinstance(x, float) else str(x) for x in cells]


def versions(jobs: Sequence[Mapping[str, Any]]) -> list[str]:
    """What the jobs ran with, each combination once."""
    return sorted({", ".join(f"{name} {v}" for name, v in metrics["versions"].items()) for metrics in jobs})


def kinds(table: Table) -> list[str]:
    """Class of each column: numbers stand to the right."""
    return ["text" if column.digits is None else "number" for column in table.columns]
