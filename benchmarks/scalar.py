"""The plain per-pixel loop of scalar.cpp, compiled here and now, as a yardstick."""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path

import torch

from benchmarks import workload
from benchmarks.report import Measurement, Section
from benchmarks.settings import Settings
from benchmarks.timing import Case, measure
from benchmarks.workload import Workload

SOURCE = Path(__file__).with_suffix(".cpp")
PEER = "scalar loop, 1 thread"
TENSORS = ("means", "quats", "scales", "opacities", "features", "viewmat", "K")


class Scene(ctypes.Structure):
    """`Scene` of scalar.cpp."""

    _fields_ = [
        ("n", ctypes.c_int32),
        *((name, ctypes.c_void_p) for name in TENSORS),
        ("width", ctypes.c_int32),
        ("height", ctypes.c_int32),
    ]


def compare(settings: Settings, section: Section) -> None:
    """Time the loop and ours, and the difference of their images; only the features learn."""
    compiler = next(filter(None, map(shutil.which, (os.environ.get("CXX", "c++"), "g++", "clang++"))), None)
    if compiler is None:
        section.skip(PEER, "there is no C++ compiler (CXX, c++, g++, clang++)")
        return
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        library = Path(folder) / "scalar.so"
        command = [compiler, "-std=c++17", "-O3", "-shared", "-fPIC", str(SOURCE), "-o", str(library)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            section.skip(PEER, f"{compiler}: {done.stderr.strip().splitlines()[-1]}")
            return
        _time(settings, section, ctypes.CDLL(str(library)))


def _time(settings: Settings, section: Section, library: ctypes.CDLL) -> None:
    at = (settings.scene, settings.size, settings.n_surfels, settings.device)
    made = workload.plain(*at, learned=("features",))
    forward, both, image = bind(library, made)
    cases = [
        Case("forward", settings.where(peer=PEER), {"forward": forward}),
        Case("features forward+backward", settings.where(peer=PEER), {"features forward+backward": both}),
    ]
    for threads in settings.threads:
        where = settings.where(peer=_ours(threads))
        cases.append(Case("forward", where, {"forward": made.image}, threads))
        cases.append(Case("features forward+backward", where, made.forward_backward, threads))
    section.measurements += measure(cases, max(settings.rounds - 2, 1), settings.device, "scalar loop")
    for name in ("forward", "features forward+backward"):
        theirs = section.find(name, peer=PEER)
        for threads in settings.threads:
            ours = section.find(name, peer=_ours(threads))
            section.measurements.append(theirs.over(ours, f"{name} / texgs", threads=threads))
    difference = (image - made.image().color).abs()
    where = settings.where(peer=PEER)
    section.measurements.append(
        Measurement.of("mean difference of images", where, "1", [float(difference.mean())])
    )


def bind(library: ctypes.CDLL, made: Workload) -> tuple[Callable[[], None], Callable[[], None], torch.Tensor]:
    """The loop forward, and forward and backward, on a workload's tensors; and the image that it writes."""
    a = made.arguments
    scene = Scene(len(a["means"]), *(a[name].data_ptr() for name in TENSORS), a["width"], a["height"])
    image = torch.empty(a["height"], a["width"], 3)
    grad, features = workload.interleaved(made.cotangents)["color"], torch.empty_like(a["features"])

    def forward() -> None:
        library.scalar_forward(ctypes.byref(scene), _pointer(image))

    def both() -> None:
        forward()
        library.scalar_backward(ctypes.byref(scene), _pointer(grad), _pointer(features))

    return forward, both, image


def _pointer(tensor: torch.Tensor) -> ctypes.c_void_p:
    return ctypes.c_void_p(tensor.data_ptr())


def _ours(threads: int) -> str:
    return f"texgs, {threads} thread{'s' * (threads > 1)}"
