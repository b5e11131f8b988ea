"""How the loss of an edit fell, term by term."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from texgs.core.io import write_atomic
from texgs.core.plots import words


def write_convergence(path: str | Path, curves: Mapping[str, Mapping[str, Sequence[float]]]) -> Path:
    """Write a PNG with the weighted terms of losses over iterations.

    Args:
        path: target.
        curves: values of each iteration, by term, by the name of what was edited.

    Returns:
        The path.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 3.2), dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    for name, terms in curves.items():
        for term, values in terms.items():
            axes.plot(range(1, len(values) + 1), values, label=words(f"{name}: {term}"), linewidth=1)
    axes.set_xlabel("iterations, one view each")
    axes.set_ylabel("loss of one view")
    if axes.lines:
        axes.legend(fontsize=7)
    return write_atomic(path, lambda file: figure.savefig(file, format="png", metadata={"Software": None}))
