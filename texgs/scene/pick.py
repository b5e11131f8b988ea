"""Which part of a scene a pixel shows."""

from __future__ import annotations

from dataclasses import dataclass

from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.fields.field import Composed
from texgs.fields.surfels.composition import Composition
from texgs.scene.scene import Scene


@dataclass(frozen=True)
class Picked:
    """What a pixel of a frame shows most of."""

    part: str  # MODEL or MODEL/SEGMENT
    surfel: int  # its place in the model
    share: float  # of the pixel, 0 to 1


def pick(scene: Scene, composed: Composed, camera: Camera, x: int, y: int) -> Picked | None:
    """The surfel that a pixel shows most of; None on the background.

    Args:
        scene: with its edits.
        composed: its models.
        camera: of the frame.
        x: pixels from the left, from 0.
        y: pixels from the top, from 0.

    Raises:
        ArgumentError: if the pixel is outside of the frame, or the scene is not one of surfels.
    """
    if not (0 <= x < camera.width and 0 <= y < camera.height):
        size = f"{camera.width} x {camera.height}"
        raise ArgumentError(f"pixel: expected one of a frame of {size}, got {x}, {y}")
    if not isinstance(composed, Composition):
        raise ArgumentError("pick: expected a scene of surfels, got fields of another kind")
    pixel = camera.crop(x, y, x + 1, y + 1).to(composed.device)
    shown = composed.render(pixel, scene.light, scene.edits, outputs=("statistics",))
    weights = shown.statistics.weight_sum  # type: ignore[union-attr]
    if not bool((weights > 0).any()):
        return None
    share, place = weights.max(dim=0)
    part, surfel = composed.place_of(int(place))
    name = list(scene.models)[part]
    label = int(composed.parts[part].label_of(surfel))
    segments = ["", *(f"/{segment}" for segment in scene.models[name].segments)]
    return Picked(f"{name}{segments[label]}", surfel, float(share))
