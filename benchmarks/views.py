"""Volume rendering: the caster, VTK's, and whole view sets."""

import os
import tempfile
from contextlib import redirect_stderr
from functools import partial
from io import StringIO
from pathlib import Path
from typing import Any

from benchmarks import machine
from benchmarks.report import Section
from benchmarks.settings import Settings
from benchmarks.timing import Case, measure
from tests.volume.vtk_caster import VtkCaster
from texgs.core.lens import Lens
from texgs.core.light import Light
from texgs.volume.cameras import icosphere
from texgs.volume.caster import Caster
from texgs.volume.generate import sphere
from texgs.volume.grid import Grid
from texgs.volume.render import Appearance, render_views
from texgs.volume.transfer import TransferFunction
from texgs.volume.view_set import View

LIGHT = Light("headlight")
SHELLS = TransferFunction(
    ((0.2, 0), (0.3, 0.02), (0.4, 0), (0.6, 0), (0.7, 0.5), (1, 0.5)),
    ((0, 0.3, 0.5, 0.9), (1, 0.9, 0.6, 0.2)),
)


def run(settings: Settings) -> Section:
    """Time frames and a set of 64 views.

    VTK's threads inherit the processors of the thread that starts them, so that one is set free here.
    """
    bound = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else None
    machine.unbind()
    try:
        return _run(settings)
    finally:
        if bound is not None:
            os.sched_setaffinity(0, bound)


def _run(settings: Settings) -> Section:
    section = Section()
    size, pixels, n_views = (24, 64, 2) if settings.is_quick else (128, 512, 64)
    grid, look = sphere(size), Appearance()
    shots = icosphere(3, Lens().square(pixels))[:n_views]
    where = {"volume": size, "size": pixels}
    vtk = VtkCaster(grid, look, settings.threads[-1])
    renderers: dict[str, Any] = {"texgs": Caster(grid, look), "VTK": vtk}
    cases = [
        Case("frame", where | {"by": name}, {"frame": partial(renderer.render, SHELLS, shots[0], LIGHT)})
        for name, renderer in renderers.items()
    ]
    cases.append(view_set(grid, look, shots, where | {"views": n_views}))
    section.measurements = measure(cases, settings.rounds, settings.device, "views")
    section.add_ratios("by", "texgs", ["frame"], "time")
    return section


def view_set(grid: Grid, look: Appearance, shots: list, where: dict) -> Case:
    """Render views into PNG files, the preparation of the renderer included."""

    def render() -> None:
        with tempfile.TemporaryDirectory() as folder:
            views = [View(camera, Path(folder, f"{i}.png"), LIGHT) for i, camera in enumerate(shots)]
            with redirect_stderr(StringIO()):  # its progress
                render_views(Caster(grid, look), SHELLS, views, "views")

    return Case("view set", where, {"view set": render})
