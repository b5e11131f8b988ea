"""One HTML file with all that a run has to show: pictures, tables, curves, and where each came from."""

from __future__ import annotations

import base64
import io
from collections.abc import Iterable, Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

from texgs.core.io import write_bytes
from texgs.core.plots import words as plot_words
from texgs.report.fitting import fitting
from texgs.report.looks import looks
from texgs.report.metrics_files import read
from texgs.report.scene_tables import SCENE_TABLES, label
from texgs.report.table import Table

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

    jobs = read(metrics_files)
    paths = [file for file, _ in jobs]
    tables = {"Fitting": fitting(paths)}
    makers = {**SCENE_TABLES, "looks": looks}
    tables |= {name.replace("_", " ").capitalize(): make(paths) for name, make in makers.items()}
    template = files("texgs.report").joinpath("report.html.j2").read_text(encoding="utf-8")
    environment = Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True)
    text = environment.from_string(template).render(
        sections=sections(jobs),
        tables={name: table for name, table in tables.items() if table.rows},
        curves=data_uri(curves(jobs)),
        jobs=[job(metrics) for _, metrics in jobs],
        places={path: index for index, path in enumerate(paths, start=1)},
        versions=versions([metrics for _, metrics in jobs]),
        headings=(*JOB, *SOURCE),
        kinds=kinds,
    )
    return write_bytes(path, text.encode())


def sections(jobs: Sequence[tuple[Path, Mapping[str, Any]]]) -> dict[str, list[dict[str, str]]]:
    """Pictures by data set, scenes first; each with what it shows and of which basic TF."""
    entries: dict[str, list[dict[str, str]]] = {}
    for path, metrics in sorted(jobs, key=lambda each: ("tf" in each[1], each[0])):
        for name, words in metrics.get("pictures", {}).items():
            picture = path.with_name(name)
            if picture.is_file() and name not in UNREPORTED:
                words_before = (metrics.get("tf"), label(metrics), metrics["numbers"].get("edit"))
                entry = {
                    "kind": "" if name in NARROW else "wide",
                    "uri": data_uri(picture.read_bytes()),
                    "label": " ".join(filter(None, words_before)),
                    "words": words,
                }
                entries.setdefault(metrics["dataset"], []).append(entry)
    return dict(sorted(entries.items()))


def curves(jobs: Sequence[tuple[Path, Mapping[str, Any]]]) -> bytes:
    """PNG of the losses that the phases have looked at, over iterations; empty if there are none."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    found = [m for _, m in jobs if len(m["numbers"].get("losses", ())) > 1]
    if not found:
        return b""
    figure = Figure(figsize=(8, 3.2), dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    for metrics in found:
        losses, total = metrics["numbers"]["losses"], metrics["numbers"]["iterations"]
        steps = [total * (i + 1) / len(losses) for i in range(len(losses))]
        name = f"{metrics['dataset']}/{metrics['tf']} {label(metrics)} {metrics['stage']}"
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
