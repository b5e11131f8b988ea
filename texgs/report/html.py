"""One HTML file with all that a run has to show: pictures, tables, curves, and where each came from."""

from __future__ import annotations

import base64
import io
from collections.abc import Iterable, Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

from texgs.config.variants import NO_SWEEP
from texgs.core.io import write_bytes
from texgs.core.plots import words as plot_words
from texgs.report.metrics_files import Record, of, read
from texgs.report.results import EditResult, FitResult, Result
from texgs.report.sweep import sweep
from texgs.report.sweep_figure import sweep_figure
from texgs.report.table import Table
from texgs.report.tables import TABLES

NARROW = ("scene.png", "transfer.png", "style.png", "convergence.png")  # at any width; others scroll there
UNREPORTED = ("turntable.png",)  # a film: it would be most of the report
JOB = ("stage", "dataset", "tf", "recipe", "variant", "seed", "seconds", "peak_memory_mib", "device")
SOURCE = ("config_sha", "code_sha", "git_sha", "run")


def write_report(path: str | Path, metrics_files: Iterable[str | Path]) -> Path:
    """Write a report that needs no other file.

    Args:
        path: target, .html.
        metrics_files: of all jobs to report; their pictures lie beside them.

    Returns:
        The path.

    Raises:
        ArgumentError: if a file is no metrics file, or the target cannot be written.
    """
    from jinja2 import Environment

    records = read(metrics_files)
    swept = [record for record in records if record.sweep not in ("", NO_SWEEP)]
    others = [record for record in records if record not in swept]
    tables = {name.replace("_", " ").capitalize(): make(others) for name, make in TABLES.items()}
    template = files("texgs.report").joinpath("report.html.j2").read_text(encoding="utf-8")
    environment = Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True)
    text = environment.from_string(template).render(
        sections=sections(others),
        sweeps=sweeps(swept),
        tables={name: table for name, table in tables.items() if table.rows},
        curves=data_uri(curves(of(FitResult, others))),
        jobs=[job(record.facts) for record in records],
        places={record.path: index for index, record in enumerate(records, start=1)},
        versions=versions([record.facts for record in records]),
        headings=(*JOB, *SOURCE),
        kinds=kinds,
    )
    return write_bytes(path, text.encode())


def sections(records: Sequence[Record[Any]]) -> dict[str, list[dict[str, str]]]:
    """Pictures by data set, scenes first; each with what it shows and of which basic TF."""
    entries: dict[str, list[dict[str, str]]] = {}
    for record in sorted(records, key=lambda each: (each.tf is not None, each.path)):
        for name, words in record.facts.get("pictures", {}).items():
            picture = record.path.with_name(name)
            if picture.is_file() and name not in UNREPORTED:
                entry = {
                    "kind": "" if name in NARROW else "wide",
                    "uri": data_uri(picture.read_bytes()),
                    "label": " ".join(filter(None, (record.tf, record.label, edit_of(record.result)))),
                    "words": words,
                }
                entries.setdefault(record.dataset, []).append(entry)
    return dict(sorted(entries.items()))


def sweeps(records: Sequence[Record[Any]]) -> dict[str, tuple[Table, str]]:
    """The table and the figure of each sweep by its name."""
    compared = [record for record in records if isinstance(record.result, FitResult | EditResult)]
    names = sorted({record.sweep for record in compared if record.variant})
    return {name: (sweep(records, name), data_uri(sweep_figure(records, name))) for name in names}


def edit_of(result: Result) -> str:
    """The name of an edit; empty for other jobs."""
    return result.edit if isinstance(result, EditResult) else ""


def curves(records: Sequence[Record[FitResult]]) -> bytes:
    """PNG of the losses that the phases have looked at, over iterations; empty if there are none."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    shown = [record for record in records if len(record.result.losses) > 1]
    if not shown:
        return b""
    figure = Figure(figsize=(8, 3.2), dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    for record in shown:
        losses, total = record.result.losses, record.result.iterations
        steps = [total * (i + 1) / len(losses) for i in range(len(losses))]
        name = f"{record.dataset}/{record.tf} {record.label} {record.stage}"
        axes.semilogy(steps, losses, label=plot_words(name))
    axes.set_xlabel("iterations")
    axes.set_ylabel("loss of one view")
    axes.legend(fontsize=7)
    file = io.BytesIO()
    figure.savefig(file, format="png", metadata={"Software": None})
    return file.getvalue()


def job(metrics: Mapping[str, Any]) -> list[str]:
    """The cells of one job in the list of where things came from."""
    cells = [metrics.get(key) for key in (*JOB, *SOURCE)]
    return ["" if x is None else f"{x:.1f}" if isinstance(x, float) else str(x) for x in cells]


def versions(jobs: Sequence[Mapping[str, Any]]) -> list[str]:
    """What the jobs ran with, each combination once."""
    return sorted({", ".join(f"{name} {v}" for name, v in metrics["versions"].items()) for metrics in jobs})


def kinds(table: Table) -> list[str]:
    """Class of each column: numbers stand to the right."""
    return ["text" if column.digits is None else "number" for column in table.columns]


def data_uri(png: bytes) -> str:
    """A picture as text for the attribute of a tag; empty for none."""
    return f"data:image/png;base64,{base64.b64encode(png).decode()}" if png else ""
