"""Memory of a forward and a backward pass, each in a process of its own."""

import ctypes
import json
import re
import sys
from pathlib import Path

import torch

from benchmarks import machine, scenes, workload
from benchmarks.report import Measurement, Section
from benchmarks.settings import Settings
from texgs.core.camera import Camera
from texgs.raster import native

LARGE = {"surfels": 1_000_000, "width": 1920, "height": 1080}
STATUS = Path("/proc/self/status")


def run(settings: Settings) -> Section:
    """Measure the middle of everything, and a million surfels in full HD."""
    section = Section()
    views = [{"surfels": settings.n_surfels, "width": settings.size, "height": settings.size}]
    if settings.is_quick:
        section.skip("a million surfels at 1920 x 1080", "--quick")
    else:
        views.append(LARGE)
    for view in views:
        where = {"scene": settings.scene, **view}
        process = machine.child("memory.child", json.dumps(where | {"device": settings.device.type}))
        said, complaint = process.communicate()
        if process.returncode:
            name = f"{view['surfels']} surfels at {view['width']} x {view['height']}"
            section.skip(name, machine.last_line(complaint))
            continue
        peaks = json.loads(machine.last_line(said))
        section.measurements += [Measurement.of(name, where, "MB", [1e-6 * x]) for name, x in peaks.items()]
    if settings.device.type == "cpu" and not STATUS.exists():
        section.skip("resident", "this system does not report the peak of a process's resident memory")
    return section


def child() -> None:
    """Print peaks in bytes of a forward and a backward pass as described in the first argument."""
    view = json.loads(sys.argv[1])
    device = torch.device(view["device"])
    workload.plain("light", 16, 100, device).image()  # the library itself is not the scene's memory
    camera = _camera(view["width"], view["height"])
    made = workload.plain(view["scene"], camera, view["surfels"], device)
    native.peak_memory(reset=True, device_type=device.type)
    _return_free_memory()
    before = _resident("VmRSS")
    if device.type == "cuda":
        before = torch.cuda.memory_allocated(device)
        torch.cuda.reset_peak_memory_stats(device)
    made.forward()
    made.backward()
    peaks = {"scratch of the library": native.peak_memory(device_type=device.type)}
    if device.type == "cuda":
        peaks["growth of torch"] = torch.cuda.max_memory_allocated(device) - before
    elif STATUS.exists():
        peaks["resident growth"] = _resident("VmHWM") - before
    print(json.dumps(peaks))


def _camera(width: int, height: int) -> Camera:
    """The scenes' camera with an image of any shape, the field of view being the vertical one."""
    view = scenes.camera(height)
    K = view.K.clone()
    K[0, 2] = 0.5 * width
    return Camera(view.viewmat, K, width, height)


def _return_free_memory() -> None:
    """Give back what generating the scene has left in the heap: it would serve the passes unseen."""
    libc = ctypes.CDLL(None) if STATUS.exists() else None
    if hasattr(libc, "malloc_trim"):  # of glibc
        libc.malloc_trim(0)


def _resident(field: str) -> int:
    """Bytes of resident memory now (VmRSS) or at the peak (VmHWM); 0 where the system does not tell."""
    if not STATUS.exists():
        return 0
    return 1024 * int(re.search(rf"{field}:\s*(\d+)", STATUS.read_text())[1])
