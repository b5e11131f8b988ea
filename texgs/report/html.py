"""One HTML report of a run: tables, pictures, curves, and the origin of each."""

import os
from collections.abc import Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import Any
from urllib.parse import quote

from PIL import Image

from texgs.core.figures import as_picture, new_figure, words
from texgs.core.io import write_bytes
from texgs.report.metrics_files import LeftOut, Record, of
from texgs.report.overview import overviews_of
from texgs.report.published import PAPER_LABEL, in_order
from texgs.report.results import SECTIONS, FitResult
from texgs.report.sections import Figure, data_uri, figures, held_pages
from texgs.report.sweep_figure import sweep_figure
from texgs.report.table import SOURCES, Table, report_file
from texgs.report.tables import specs, sweeps_of, tables_of

JOB_FACTS = (
    "stage",
    "dataset",
    "tf",
    "recipe",
    "edit",
    "variant",
    "seed",
    "seconds",
    "peak_memory_mib",
    "device",
)
SOURCE_FACTS = ("config_sha", "code_sha", "git_sha", "run")
LOSS_CAPTION = "Loss of single views while fields were fitted."
SWEEP_CAPTION = (
    "Means over seeds with their standard deviation, of what differs; below them the edited scenes."
)


def write_report(
    path: str | Path,
    records: Sequence[Record[Any]],
    left_out: Sequence[LeftOut] = (),
    given: Mapping[str, Table] | None = None,
    more: Mapping[str, Sequence[Figure]] | None = None,
) -> Path:
    """Write a report that needs no other files, except pages of scenes that would make it too large to mail.

    Tables by name and figures by section that need more than records are `given` and `more`.
    """
    from jinja2 import Environment

    template = report_file("report.html.j2")
    environment = Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True)
    pictures = figures(records)
    pictures["fitting"] += loss_figures(records)
    pictures["ablations"] += sweep_figures(records)
    for section, own in (more or {}).items():
        pictures[section] += own
    overviews = overviews_of(records, pictures.pop("overview"))
    shown = [*chain(*pictures.values()), *chain(*(each.figures for each in overviews))]
    folder = Path(path).resolve().parent
    text = environment.from_string(template).render(
        title=", ".join(each.title for each in overviews),
        overviews=overviews,
        held=held_pages(shown),
        link=lambda page: quote(Path(os.path.relpath(page, folder)).as_posix()),
        sections=sections(records, tables_of(records, left_out, given), pictures),
        left_out=left_out,
        jobs=[job(record.facts) for record in records],
        places={record.path: index for index, record in enumerate(records, start=1)},
        versions=versions([record.facts for record in records]),
        headings=(*JOB_FACTS, *SOURCE_FACTS),
        sources_from=len(JOB_FACTS),
        is_theirs=lambda cells: any(cell.startswith(PAPER_LABEL) for cell in cells),
        sources=SOURCES,
    )
    return write_bytes(path, text.encode())


def sections(
    records: Sequence[Record[Any]], tables: Mapping[str, Table], pictures: Mapping[str, list[Figure]]
) -> list[dict[str, Any]]:
    """Return the non-empty sections, with tables by name and figures by data set."""
    places = {spec.name: spec.section for spec in specs(sweeps_of(records))}
    shown = []
    for key, title in SECTIONS.items():
        own = {name: table for name, table in tables.items() if not table.is_empty and places[name] == key}
        by_dataset: dict[str, list[Figure]] = {}
        for figure in pictures.get(key, ()):
            by_dataset.setdefault(figure.dataset, []).append(figure)
        if own or by_dataset:
            shown.append({"key": key, "title": title, "tables": own, "figures": by_dataset})
    return shown


def loss_figures(records: Sequence[Record[Any]]) -> list[Figure]:
    """Draw curves of all phases outside of sweeps that recorded several losses."""
    by_dataset: dict[str, list[Record[FitResult]]] = {}
    for record in in_order(of(FitResult, records)):
        if len(record.result.losses) > 1 and not record.is_swept:
            by_dataset.setdefault(record.title, []).append(record)
    drawn = {title: data_uri(curves(phases)) for title, phases in by_dataset.items()}
    return [Figure(title, "", LOSS_CAPTION, uri, "", is_narrow=True) for title, uri in drawn.items()]


def sweep_figures(records: Sequence[Record[Any]]) -> list[Figure]:
    """Draw the measures and scenes of each sweep."""
    drawn = {name: data_uri(sweep_figure(records, name)) for name in sweeps_of(records)}
    return [Figure(f"sweep {name}", "", SWEEP_CAPTION, uri, "") for name, uri in drawn.items()]


def curves(phases: Sequence[Record[FitResult]]) -> Image.Image:
    """Draw losses over iterations, a curve for each phase of each basic TF."""
    from texgs.fitting.checkpoint import noted_at

    figure = new_figure(8, 3.2, 120)
    axes = figure.subplots()
    axes.set(xlabel="iterations", ylabel="loss of one view")
    for phase in phases:
        losses, total = phase.result.losses, phase.result.iterations
        steps = noted_at(len(losses), total, total)
        axes.semilogy(steps, losses, label=words(f"{phase.tf} {phase.label} {phase.stage}"))
    axes.legend(fontsize=7)
    return as_picture(figure)


def job(metrics: Mapping[str, Any]) -> list[str]:
    """Return the cells of one job in the list of origins."""
    facts = {"edit": metrics["numbers"].get("edit"), **metrics}
    cells = [facts.get(key) for key in (*JOB_FACTS, *SOURCE_FACTS)]
    return ["" if x is None else f"{x:.1f}" if isinstance(x, float) else str(x) for x in cells]


def versions(jobs: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return the versions that jobs ran with, each combination once."""
    return sorted({", ".join(f"{name} {v}" for name, v in metrics["versions"].items()) for metrics in jobs})
