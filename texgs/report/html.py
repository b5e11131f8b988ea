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
from texgs.report.metrics_files import PHASES, read
from texgs.report.scene_tables import SCENE_TABLES, label
from texgs.report.table import Table

PICTURES = {  # files beside the metrics of a stage, and what they show
    "compose": {"scene.png": "The basic models as one scene, rendered from their surfels."},
    "pse": {
        "pse.png": "Edits of colour, opacity and light; below each the volume with the same edit.",
        "relight.png": "A light that moves from below to above, and the volume under the same light.",
    },
    "edit_image": {
        "style.png": "The style picture.",
        "edit.png": "Before and after the edit, under the light of the scene and under another one.",
        "convergence.png": "Terms of the loss in each iteration.",
    },
    "edit_text": {
        "views.png": "Views before and after they were edited as the instruction says.",
        "edit.png": "Before and after the edit, under the light of the scene and under another one.",
    },
    "edit_segment": {
        "edit.png": "Clicks with the mask of their view, and the segment that all views agree on."
    },
    "transfer": {"transfer.png": "Histogram of the volume with the basic transfer functions."},
    "sheet": {"sheet.png": "Views that the model was fitted to, and test views."},
    "figure": {"figure.png": "Test views, the phases of the fit, errors, normals, depth and material."},
}
ORDER = tuple(PICTURES)
NARROW = (
    "scene.png",
    "transfer.png",
    "style.png",
    "convergence.png",
)  # readable at any width; the others scroll on a narrow window
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
    found: dict[str, list[dict[str, str]]] = {}
    shown = [(path, metrics) for path, metrics in jobs if metrics["stage"] in PICTURES]
    for path, metrics in sorted(shown, key=lambda each: (ORDER.index(each[1]["stage"]), each[0])):
        for name, words in PICTURES[metrics["stage"]].items():
            picture = path.with_name(name)
            if picture.is_file():
                words_before = (metrics.get("tf"), label(metrics), metrics["numbers"].get("edit"))
                entry = {
                    "kind": "" if name in NARROW else "wide",
                    "uri": data_uri(picture.read_bytes()),
                    "label": " ".join(filter(None, words_before)),
                    "words": words,
                }
                found.setdefault(metrics["dataset"], []).append(entry)
    return dict(sorted(found.items()))


def curves(jobs: Sequence[tuple[Path, Mapping[str, Any]]]) -> bytes:
    """PNG of the losses that the phases have looked at, over iterations; empty if there are none."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    found = [m for _, m in jobs if m["stage"] in PHASES and len(m["numbers"].get("losses", ())) > 1]
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
