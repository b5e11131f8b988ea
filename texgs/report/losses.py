"""How the losses of fits fell, a figure for each data set."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Any

from PIL import Image

from texgs.core.plots import words
from texgs.report.metrics_files import Record, of
from texgs.report.published import in_order
from texgs.report.results import FitResult
from texgs.report.sections import Figure, data_uri


def loss_figures(records: Sequence[Record[Any]]) -> list[Figure]:
    """Curves of the phases that have looked at their loss more than once, but for those of sweeps."""
    by_dataset: dict[str, list[Record[FitResult]]] = {}
    for record in in_order(of(FitResult, records)):
        if len(record.result.losses) > 1 and not record.is_swept:
            by_dataset.setdefault(record.title, []).append(record)
    return [
        Figure(
            title, "", "Loss of single views while fields were fitted.", data_uri(curves(phases)), "", True
        )
        for title, phases in by_dataset.items()
    ]


def curves(phases: Sequence[Record[FitResult]]) -> Image.Image:
    """A plot of losses over iterations, a curve for each phase of each basic TF."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure as Page

    page = Page(figsize=(8, 3.2), dpi=120, layout="constrained")
    FigureCanvasAgg(page)
    axes = page.subplots()
    for phase in phases:
        losses, total = phase.result.losses, phase.result.iterations
        steps = [total * (index + 1) / len(losses) for index in range(len(losses))]
        axes.semilogy(steps, losses, label=words(f"{phase.tf} {phase.label} {phase.stage}"))
    axes.set_xlabel("iterations")
    axes.set_ylabel("loss of one view")
    axes.legend(fontsize=7)
    file = io.BytesIO()
    page.savefig(file, format="png")
    return Image.open(file)
