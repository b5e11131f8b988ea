"""Films of a scene: a camera, a light or a cut that moves."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import repeat
from typing import TYPE_CHECKING

from texgs.core.errors import ArgumentError

if TYPE_CHECKING:
    from texgs.core.camera import Camera
    from texgs.core.lens import Lens
    from texgs.fields.field import Composed
    from texgs.scene.scene import Scene

MARGIN = 0.1  # of the extent of what is visible: from its end to where a plane that moves starts or ends
# Frames by default.
PATHS = {"view": 1, "test": 181, "orbit": 72, "light": 61, "cut": 61, "time": 61, "orbit-time": 72}


def shots_of(
    scene: Scene,
    composition: Composed,
    path: str,
    count: int,
    lens: Lens,
    azimuth: float = 30.0,
    polar: float = 20.0,
) -> Iterator[tuple[Camera, Scene]]:
    """Return camera and scene of each frame of a film.

    Args:
        scene: to show.
        composition: its models.
        path: what moves, one of `PATHS`: nothing in `view`; the camera on the path of test views or around
            the scene; the light, as the paper shows relighting; the last plane that cuts, through it all;
            time, through the steps of the series; or both, camera and time.
        count: of frames.
        lens: of the camera.
        azimuth: of the camera, degrees; where it moves around the scene, of the first frame.
        polar: of the camera, degrees above the horizon; a path of test views has its own.

    Raises:
        ArgumentError: if a cut or time is to move, and the scene has none.
    """
    from texgs.core.camera import orbit
    from texgs.core.light import Light
    from texgs.volume.cameras import orbit_path, spiral

    if path == "test":
        return ((camera, scene) for camera in spiral(count, lens, "frames"))
    if path == "orbit":
        return ((camera, scene) for camera in orbit_path(count, polar, lens, start=azimuth))
    camera = orbit(azimuth, polar, *lens)
    if path == "view":
        return ((camera, scene) for _ in range(count))
    shares = (i / max(count - 1, 1) for i in range(count))
    if path in ("time", "orbit-time"):
        last = len(scene.timeline.steps) - 1
        turn = orbit_path(count, polar, lens, start=azimuth) if path == "orbit-time" else repeat(camera)
        return ((place, scene.at(round(share * last))) for place, share in zip(turn, shares, strict=False))
    if path == "cut":
        low, high = swept(scene, composition)
        return ((camera, moved(scene, high + share * (low - high))) for share in shares)
    # from below the object to above it, on the camera's side
    lights = (Light("directional", azimuth, -90 + 180 * share) for share in shares)
    return ((camera, replace(scene, light=light)) for light in lights)


def swept(scene: Scene, composition: Composed) -> tuple[float, float]:
    """Return between which offsets the last plane moves: both ends show something."""
    from texgs.scene.bounds import STRAYS, models_of, span_of

    if not scene.cuts.planes:
        raise ArgumentError("path cut: expected a scene that a plane cuts, got none; texgs edit cut=x,0")
    models = zip(models_of(composition), scene.models.values(), strict=False)  # none of them without means
    shown = [model for model, entry in models if entry.edit.visible or entry.segments]
    low, high = span_of(shown, scene.framed(composition), scene.cuts.planes[-1].normal, STRAYS)
    return low + MARGIN * (high - low), high - MARGIN * (high - low)


def moved(scene: Scene, offset: float) -> Scene:
    """Return a scene whose last plane has another offset."""
    *others, last = scene.cuts.planes
    return replace(scene, cuts=replace(scene.cuts, planes=[*others, replace(last, offset=offset)]))
