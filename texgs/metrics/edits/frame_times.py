"""Metric `frame_times`: rendering times of the edited scene."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from statistics import fmean
from typing import TYPE_CHECKING

from texgs.metrics.metric import Measure, MeasuredScene, Metric

if TYPE_CHECKING:
    from texgs.core.camera import Camera

WARM_UP_FRAMES = 3
TIMED_FRAMES = 8  # spread over the path; their mean is within 2 % of the mean of all


def milliseconds(render: Callable[[Camera], object], cameras: Sequence[Camera], title: str) -> list[float]:
    """Measure the milliseconds of each frame after some warm-up frames."""
    import torch

    from texgs.core.progress import progress

    def milliseconds_of(camera: Camera) -> float:
        start = time.perf_counter()
        render(camera)
        if torch.cuda.is_initialized():
            torch.cuda.synchronize()
        return 1e3 * (time.perf_counter() - start)

    for camera in cameras[:WARM_UP_FRAMES]:
        milliseconds_of(camera)
    return [milliseconds_of(camera) for camera in progress(cameras, title=title, unit="frame")]


def run(measured: MeasuredScene) -> dict[str, float]:
    """Render frames spread over the test path."""
    from texgs.volume.cameras import spread

    scene, composition = measured.after, measured.shown
    frames = milliseconds(
        lambda camera: composition.render(camera, scene.light, scene.edits),
        spread(measured.cameras, TIMED_FRAMES),
        measured.title,
    )
    return {"frame_mean_ms": fmean(frames), "frame_max_ms": max(frames)}


METRIC = Metric(
    "frame_times",
    (
        Measure("frame_mean_ms", "mean ms", 2, "down", "render_mean_ms"),
        Measure("frame_max_ms", "max ms", 2, "down", "render_max_ms"),
    ),
    run,
    order=30,
)
