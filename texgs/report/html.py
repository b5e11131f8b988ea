"""One HTML file with all that a run has to show: tables, pictures, curves, and where each came from."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from PIL import Image

from texgs.core.io import write_bytes
from texgs.report.ballots import Votes
from texgs.report.left_out import LeftOut, others
from texgs.report.losses import loss_figures
from texgs.report.metrics_files import Record, read_known
from texgs.report.published import THEIRS
from texgs.report.sections import SECTIONS, Figure, data_uri, figures
from texgs.report.sweep_figure import sweep_figure
from texgs.report.table import Row, Table
from texgs.report.tables import specs, sweeps_of, tables_of
from texgs.report.votes_figure import write_votes

JOB = ("stage", "dataset", "tf", "recipe", "edit", "variant", "seed", "seconds", "peak_memory_mib", "device")
SOURCE = ("config_sha", "code_sha", "git_sha", "run")
SWEPT = "Means over seeds with their standard deviation, of what differs; below them the edited scenes."


@dataclass(frozen=True)
class Section:
    """A part of the report."""

    key: str
    title: str
    tables: dict[str, Table]  # by name
    figures: dict[str, list[Figure]]  # by data set


def write_report(
    path: str | Path,
    metrics_files: Iterable[str | Path],
    left_out: Sequence[LeftOut] = (),
    votes: Votes | None = None,
) -> Path:
    """Write a report that needs no other file, but for pages of scenes that are too large for it.

    Args:
        path: target, .html.
        metrics_files: of all jobs to report; their pictures lie beside them.
        left_out: what of the run is not there.
        votes: of a user study.

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
        sections=sections(records, left_out, votes, Path(path).resolve().parent),
        left_out=[*left_out, *others(old)],
        jobs=[job(record.facts) for record in records],
        places={record.path: index for index, record in enumerate(records, start=1)},
        versions=versions([record.facts for record in records]),
        headings=(*JOB, *SOURCE),
        sources_from=len(JOB),
        kinds=kinds,
        is_theirs=is_theirs,
    )
    return write_bytes(path, text.encode())


def sections(
    records: Sequence[Record[Any]], left_out: Sequence[LeftOut], votes: Votes | None, folder: Path
) -> list[Section]:
    """The sections that have something to show; `folder`: of the report."""
    pictures, tables = figures(records, folder), tables_of(records, left_out, votes)
    places = {spec.name: spec.section for spec in specs(sweeps_of(records))}
    pictures["fitting"] += loss_figures(records)
    pictures["ablations"] += [shown_sweep(records, name) for name in sweeps_of(records)]
    if tables["user_study"].rows:
        pictures["study"].append(votes_shown(votes))
    shown = []
    for key, title in SECTIONS.items():
        own = {name: table for name, table in tables.items() if table.rows and places[name] == key}
        by_dataset: dict[str, list[Figure]] = {}
        for figure in pictures[key]:
            by_dataset.setdefault(figure.dataset, []).append(figure)
        if own or by_dataset:
            shown.append(Section(key, title, own, by_dataset))
    return shown


def shown_sweep(records: Sequence[Record[Any]], name: str) -> Figure:
    """The figure of a sweep."""
    return Figure(f"sweep {name}", "", SWEPT, data_uri(sweep_figure(records, name)), "")


def votes_shown(votes: Votes | None) -> Figure:
    """The figure of a user study."""
    with TemporaryDirectory() as folder, Image.open(write_votes(Path(folder, "votes.png"), votes)) as picture:
        command = "texgs votes" if votes else ""
        return Figure("votes", "", "Votes for each rank.", data_uri(picture), command, is_narrow=True)


def job(metrics: Mapping[str, Any]) -> list[str]:
    """The cells of one job in the list of where things came from."""
    facts = {"edit": metrics["numbers"].get("edit"), **metrics}
    cells = [facts.get(key) for key in (*JOB, *SOURCE)]
    return ["" if x is None else f"{x:.1f}" if isinstance(x, float) else str(x) for x in cells]


def versions(jobs: Sequence[Mapping[str, Any]]) -> list[str]:
    """What the jobs ran with, each combination once."""
    return sorted({", ".join(f"{name} {v}" for name, v in metrics["versions"].items()) for metrics in jobs})


def is_theirs(row: Row) -> bool:
    """Whether a row has the paper's numbers alone."""
    return any(isinstance(cell, str) and cell.startswith(THEIRS) for cell in row.cells)


def kinds(table: Table) -> list[str]:
    """Class of each column: numbers stand to the right."""
    return ["text" if column.digits is None else "number" for column in table.columns]
