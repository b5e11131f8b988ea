"""Metric `geometry`: whether an edit has left the geometry as it was."""

from __future__ import annotations

from typing import TYPE_CHECKING

from texgs.metrics.metric import Measure, MeasuredScene, Metric

if TYPE_CHECKING:
    from texgs.core.camera import Camera


def run(measured: MeasuredScene) -> dict[str, bool]:
    """Compare depth, alpha and, where there are any, normals of all views bit for bit."""
    import torch

    outputs = ("depth", "normal") if measured.has_normals else ("depth",)

    def is_same(camera: Camera) -> bool:
        frames = [scene.render(camera, outputs=outputs) for scene in measured.compositions]
        planes = [[getattr(frame, name) for name in ("alpha", *outputs)] for frame in frames]
        return all(map(torch.equal, *planes))

    with torch.no_grad():
        return {"geometry_kept": all(map(is_same, measured.some))}


METRIC = Metric(
    "geometry",
    (Measure("geometry_kept", "geometry kept", words={True: "bit for bit", False: "no"}),),
    run,
    order=60,
)
