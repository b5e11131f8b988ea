"""Volume rendering: the caster, VTK's without and with OpenGL, and whole view sets."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from contextlib import redirect_stderr
from functools import partial
from io import StringIO
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from benchmarks import machine
from benchmarks.memory import ROOT
from benchmarks.report import Measurement, Section
from benchmarks.settings import Settings
from benchmarks.timing import Case, measure
from tests.volume.vtk_caster import VtkCaster
from texgs.core.camera import orbit
from texgs.core.errors import DeviceError
from texgs.core.lens import Lens
from texgs.core.light import Light
from texgs.volume.appearance import Appearance, image_data, volume_property
from texgs.volume.cameras import icosphere
from texgs.volume.caster import Caster
from texgs.volume.generate import sphere
from texgs.volume.grid import Grid
from texgs.volume.opengl import offscreen_opengl
from texgs.volume.render import render_views
from texgs.volume.transfer import TransferFunction
from texgs.volume.view_set import View
from texgs.volume.vtk_camera import aim

LIGHT = Light("headlight")
SHELLS = TransferFunction(
    ((0.2, 0), (0.3, 0.02), (0.4, 0), (0.6, 0), (0.7, 0.5), (1, 0.5)),
    ((0, 0.3, 0.5, 0.9), (1, 0.9, 0.6, 0.2)),
)
LARGE, REDUCE = 2048, 8  # side of a raw volume that is larger than its reader's memory


def run(settings: Settings) -> Section:
    """Time frames and a set of 64 views; measure what opening a large volume takes.

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
    shots = icosphere(3, *Lens().square(pixels))[:n_views]
    where = {"volume": size, "size": pixels}
    vtk = VtkCaster(grid, look, settings.threads[-1])
    mappers: dict[str, Any] = {"texgs": Caster(grid, look), "VTK": vtk}
    cases = [
        Case("frame", where | {"by": name}, {"frame": partial(mapper.render, SHELLS, shots[0], LIGHT)})
        for name, mapper in mappers.items()
    ]
    try:
        offscreen_opengl()
        cases.append(peer(grid, look, shots[0], where | {"by": "VTK in PyVista, OpenGL"}))
    except DeviceError as error:
        section.skip("VTK shown by PyVista", str(error))
    cases.append(view_set(grid, look, shots, where | {"views": n_views}))
    section.measurements = measure(cases, settings.rounds, settings.device, "views")
    own = section.find("frame", by="texgs")
    for case in cases[1:-1]:
        section.measurements.append(section.find("frame", by=case.parameters["by"]).over(own, "time / texgs"))
    if settings.is_quick:
        section.skip(f"a raw volume of {LARGE}^3", "--quick")
    else:
        section.measurements += large_volume()
    return section


def peer(grid: Grid, look: Appearance, camera, where: dict) -> Case:
    """The same mapper in a PyVista plotter: drawn by OpenGL, read back as 8 bits."""
    import pyvista
    from vtkmodules.vtkRenderingCore import vtkVolume
    from vtkmodules.vtkRenderingVolume import vtkFixedPointVolumeRayCastMapper

    image, factor = image_data(grid)
    mapper, volume = vtkFixedPointVolumeRayCastMapper(), vtkVolume()
    mapper.SetInputData(image)
    mapper.SetAutoAdjustSampleDistances(0)
    mapper.SetSampleDistance(look.step * min(image.GetSpacing()))
    volume.SetMapper(mapper)
    volume.SetProperty(volume_property(SHELLS, look, factor))
    plotter = pyvista.Plotter(off_screen=True, lighting="none", window_size=(camera.width, camera.height))
    plotter.add_light(pyvista.Light(light_type="headlight"))
    plotter.renderer.AddVolume(volume)
    aim(plotter.camera, camera)

    def show() -> None:
        plotter.render()
        plotter.screenshot(None, transparent_background=True, return_img=True)

    return Case("frame", where, {"frame": show})


def view_set(grid: Grid, look: Appearance, shots: list, where: dict) -> Case:
    """Render views into PNG files, the mapper's preparation included."""

    def render() -> None:
        with tempfile.TemporaryDirectory() as folder:
            views = [View(camera, Path(folder, f"{i}.png"), LIGHT) for i, camera in enumerate(shots)]
            with redirect_stderr(StringIO()):  # its progress
                render_views(Caster(grid, look), SHELLS, views, "views")

    return Case("view set", where, {"view set": render})


def large_volume() -> list[Measurement]:
    """Seconds and memory of a sparse raw file of 8 GB, read reduced and cast as it is, each in a process."""
    with tempfile.TemporaryDirectory() as folder:
        raw = Path(folder, "large.raw")
        with raw.open("wb") as file:
            file.truncate(LARGE**3)
            file.seek(LARGE**3 // 2)
            file.write(np.arange(256, dtype=np.uint8).tobytes())
        seconds, resident = in_child("reduced", raw)
        ready, frame, own = in_child("cast", raw)
    reduced, whole = {"volume": LARGE, "reduce": REDUCE}, {"volume": LARGE, "size": 800}
    return [
        Measurement.of("open a raw file", reduced, "ms", [1e3 * seconds]),
        Measurement.of("resident", reduced, "MB", [resident]),
        Measurement.of("make ready to cast", whole, "ms", [1e3 * ready]),
        Measurement.of("cast a frame", whole, "ms", [1e3 * frame]),
        Measurement.of("memory but for the mapped file", whole, "MB", [own]),
    ]


def in_child(work: str, raw: Path) -> list[float]:
    """What a function of this module prints of a raw file, in a process of its own."""
    code = f"from pathlib import Path; from benchmarks.views import {work}; {work}(Path({str(raw)!r}))"
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
        preexec_fn=machine.unbind,
    )
    return [float(number) for number in done.stdout.split()]


def reduced(raw: Path) -> None:
    """Print the seconds and the peak of resident memory in MB of preparing the large volume."""
    from texgs.core.memory import peak_memory
    from texgs.volume.prepare import prepare
    from texgs.volume.sources import open_source

    start = perf_counter()
    source = open_source(raw, dims=(LARGE,) * 3, dtype="uint8")
    prepare(source, raw.with_name("small.nrrd"), reduce=REDUCE)
    print(perf_counter() - start, peak_memory() / 1e6)


def cast(raw: Path) -> None:
    """Print the seconds until the large volume can be cast, those of a second frame, and MB of memory.

    The system counts pages of the mapped file as resident until it takes them back; they are left out.
    """
    start = perf_counter()
    caster = Caster(Grid(np.memmap(raw, np.uint8, "r", shape=(LARGE,) * 3)), Appearance(step=0.5))
    ready = perf_counter() - start
    tf = TransferFunction(((20, 0.0), (255, 0.9)), ((0, 0.9, 0.6, 0.2),))
    for azimuth in (-60, -30):
        start = perf_counter()
        caster.render(tf, orbit(azimuth, 20, 2.5, 30, 800, 800), LIGHT)
    own = re.search(r"RssAnon:\s+(\d+) kB", Path("/proc/self/status").read_text())
    print(ready, perf_counter() - start, 1024 * int(own[1]) / 1e6 if own else float("nan"))
