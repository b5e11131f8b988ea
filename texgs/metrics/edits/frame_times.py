"""Metric `frame_times`: how long frames of the edited scene take."""

from __future__ import annotations

from statistics import fmean

from texgs.metrics.metric import Measure, MeasuredScene, Metric


def run(measured: MeasuredScene) -> dict[str, float]:
    """Render frames that are spread over the test path."""
    from texgs.metrics.timing import FRAMES, milliseconds
    from texgs.volume.cameras import spread

    scene, composition = measured.after, measured.shown
    frames = milliseconds(
        lambda camera: composition.render(camera, scene.light, scene.edits),
        spread(measured.cameras, FRAMES),
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
