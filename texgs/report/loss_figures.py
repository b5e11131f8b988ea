"""Curves of losses: of an edit, term by term, and of the fits of each data set."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from PIL import Image

from texgs.core.figures import as_picture, new_figure, words, write_figure
from texgs.report.metrics_files import Record, of
from texgs.report.published import in_order
from texgs.report.results import FitResult
from texgs.report.sections import Figure, data_uri

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Page


def write_convergence(path: str | Path, curves: Mapping[str, Mapping[str, Sequence[float]]]) -> Path:
    """Write a PNG with the weighted terms of an edit's losses over iterations.

    Args:
        path: target.
        curves: values of each iteration, by term, by the name of what was edited.

    Returns:
        The path.
    """
    figure, axes = new_plot("iterations, one view each")
    for name, terms in curves.items():
        for term, values in terms.items():
            axes.plot(range(1, len(values) + 1), values, label=words(f"{name}: {term}"), linewidth=1)
    if axes.lines:
        axes.legend(fontsize=7)
    return write_figure(path, figure)


def loss_figures(records: Sequence[Record[Any]]) -> list[Figure]:
    """Draw curves of the phases that have looked at their loss more than once, but for those of sweeps."""
    by_dataset: dict[str, list[Record[FitResult]]] = {}
    for record in in_order(of(FitResult, records)):
        if len(record.result.losses) > 1 and not record.is_swept:
            by_dataset.setdefault(record.title, []).append(record)
    shown = "Loss of single views while fields were fitted."
    return [
        Figure(title, "", shown, data_uri(curves(phases)), "", is_narrow=True)
        for title, phases in by_dataset.items()
    ]


def curves(phases: Sequence[Record[FitResult]]) -> Image.Image:
    """Draw losses over iterations, a curve for each phase of each basic TF."""
    figure, axes = new_plot("iterations")
    for phase in phases:
        losses, total = phase.result.losses, phase.result.iterations
        steps = [total * (index + 1) / len(losses) for index in range(len(losses))]
        axes.semilogy(steps, losses, label=words(f"{phase.tf} {phase.label} {phase.stage}"))
    axes.legend(fontsize=7)
    return as_picture(figure)


def new_plot(steps: str) -> tuple[Page, Axes]:
    """Return a figure with axes for losses over iterations."""
    figure = new_figure(8, 3.2, 120)
    axes = figure.subplots()
    axes.set_xlabel(steps)
    axes.set_ylabel("loss of one view")
    return figure, axes
