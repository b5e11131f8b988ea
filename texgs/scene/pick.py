"""The point of a scene that a pixel of a frame shows."""

from __future__ import annotations

from typing import get_args

import torch

from texgs.core.camera import Camera
from texgs.fields.field import Composed, Look
from texgs.scene.cut_view import cut_view
from texgs.scene.scene import Scene
from texgs.scene.twin import Twin

FAINT = 0.1  # alpha below which a pixel counts as background
HOLLOW = {"normal", "depth", *get_args(Look)} - {"shaded"}  # modes that show no faces of cuts


def point_at(
    composed: Composed, camera: Camera, scene: Scene, mode: str, twin: Twin | None, pixel: tuple[int, int]
) -> list[float] | None:
    """Return the point [3] of the world that a pixel (column, row) shows; None for the background.

    It lies at the mean depth of the models. Where the twin is seen it lies where half of the light is gone,
    or if it never is, at the mean depth of the volume.
    """
    column, row = pixel
    alone = camera.crop(column, row, column + 1, row + 1).to(composed.device)
    if twin is None or mode in HOLLOW:
        seen = cut_view(composed, alone, scene, None, outputs=("depth",))
    else:
        functions = scene.functions if mode == "volume" else None
        seen = twin.render(alone, scene, composed.palettes, functions=functions, outputs=("depth", "median"))
    if seen.depth is None or float(seen.alpha) < FAINT:
        return None
    depth = seen.depth if seen.median is None else torch.where(seen.median > 0, seen.median, seen.depth)
    return alone.unproject(depth.to(alone.viewmat))[0, 0].tolist()
