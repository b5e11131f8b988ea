"""Milliseconds of frames, measured one by one."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import torch

from texgs.core.camera import Camera
from texgs.core.progress import progress

WARM = 3  # frames before those that count
FRAMES = 61  # spread over a path: more say the same


def milliseconds(render: Callable[[Camera], object], cameras: Sequence[Camera], title: str) -> list[float]:
    """Measure the milliseconds of each frame after some that are not counted."""
    for camera in cameras[:WARM]:
        render(camera)
    _settle()
    times = []
    for camera in progress(cameras, title=title, unit="frame"):
        start = time.perf_counter()
        render(camera)
        _settle()
        times.append(1e3 * (time.perf_counter() - start))
    return times


def _settle() -> None:
    """Wait for a GPU, where one is at work."""
    if torch.cuda.is_initialized():
        torch.cuda.synchronize()
