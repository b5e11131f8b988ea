"""Metric `consistency`: how alike views are where they see the same, near and far along the test path."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from texgs.metrics.metric import Measure, MeasuredScene, Metric

if TYPE_CHECKING:
    from texgs.scene.scene import Scene


def run(measured: MeasuredScene) -> dict[str, Any]:
    """Compare views in the middle of the path, as they look with the scene's light.

    Fields that have light in their colours can be compared with others so. Nothing is returned where no two
    views see the same, as of a scene that is nowhere opaque.
    """
    import torch

    from texgs.fields.kinds import kinds
    from texgs.metrics.consistency import LONG, SHORT, consistency, frames_of
    from texgs.models.lpips import Lpips
    from texgs.scene.scene_file import read_scene

    scene, composition, count = measured.after, measured.shown, len(measured.some)
    start = max(0, (len(measured.cameras) - count - LONG) // 2)
    cameras = measured.cameras[start : start + count + LONG]
    surfaces = without_hidden(read_scene(measured.geometry_file), scene)
    depth = kinds()[next(iter(surfaces.models.values())).open()[0].kind].depth or "median"
    with torch.no_grad():
        opened = surfaces.open(composition.device)
        frames = list(frames_of(composition, cameras, scene.light, scene.edits, opened, depth))
        perceptual = None
        if measured.weights["vgg16"] and measured.weights["lpips_vgg"]:
            perceptual = Lpips.load(device=composition.device).to
        apart = [each for each in (SHORT, LONG) if each < len(frames)]
        values: dict[str, Any] = {}
        for each, compared in consistency(frames, apart, perceptual).items():
            name = "short" if each == SHORT else "long"
            values |= {f"{name}_rmse": compared.rmse, f"{name}_lpips": compared.perceptual}
    return values


def without_hidden(geometry: Scene, scene: Scene) -> Scene:
    """Return the models of the geometry but those that the scene hides; all where it hides everything."""
    hidden = {name for name, model in scene.models.items() if not model.edit.visible}
    shown = {name: model for name, model in geometry.models.items() if name not in hidden}
    return replace(geometry, models=shown or geometry.models)


METRIC = Metric(
    "consistency",
    (
        Measure("short_rmse", "RMSE, near", 4, "down"),
        Measure("long_rmse", "RMSE, far", 4, "down"),
        Measure("short_lpips", "LPIPS, near", 4, "down"),
        Measure("long_lpips", "LPIPS, far", 4, "down"),
    ),
    run,
    order=50,
)
