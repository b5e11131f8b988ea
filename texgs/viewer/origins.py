"""What the models of a scene were made from: training views and the histogram of the volume."""

import logging
from collections.abc import Sequence
from functools import cached_property
from math import asin, atan, atan2, degrees
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from texgs.config.compose import ONE_LIGHT
from texgs.core.camera import Camera, orbit
from texgs.core.errors import ArgumentError, TexgsError
from texgs.core.io import read_json
from texgs.core.lens import ORIGIN
from texgs.core.names import is_number
from texgs.fields.files import kind_of
from texgs.scene.scene import Scene
from texgs.volume.summaries import summary_file
from texgs.volume.view_set import View as Image
from texgs.volume.view_set import read_views

log = logging.getLogger("texgs.viewer")
FOLDERS_ABOVE = 5  # above a model, to look in for its views
VIEW_FOLDERS = "views", f"views{ONE_LIGHT}"
BINS = 256  # of a histogram that a page shows, at most
CAMERA_TOLERANCE = 1e-3  # elements of two equal cameras may differ by this


def find_upwards(file: Path, name: str) -> Path | None:
    """Return the nearest file of a name in the folder of a model or one above."""
    folders = file.resolve().parents[:FOLDERS_ABOVE]
    return next((folder / name for folder in folders if (folder / name).is_file()), None)


class Origins:
    """Training views of the models of a scene, and facts of its volume, as far as they are there."""

    def __init__(self, scene: Scene) -> None:
        self._views = views_of(scene)
        self._middle = scene.frame.target if scene.frame else ORIGIN
        self._volume = scene.volume

    @property
    def has_views(self) -> bool:
        """Return whether training views are there."""
        return bool(self._views)

    def nearest(self, camera: Camera, scene: Scene) -> Image:
        """Return the training view that looks most nearly as a camera does; one model is visible."""
        visible = [name for name, entry in scene.models.items() if entry.edit.visible]
        if len(visible) != 1 or visible[0] not in self._views:
            raise ArgumentError(
                f"Training views show one transfer function each: show {' or '.join(self._views)} alone "
                f"by the ticks beside names. Visible now: {', '.join(visible) or 'none'}."
            )
        forward = camera.viewmat[2, :3]
        return max(self._views[visible[0]], key=lambda each: float(forward @ each.camera.viewmat[2, :3]))

    @cached_property
    def places(self) -> list[dict[str, Any]]:
        """Return the places of the training views with +y up, for a page."""
        images = next(iter(self._views.values()), [])
        places = [(index, orbit_of(image.camera, self._middle)) for index, image in enumerate(images)]
        return [{"name": f"view {index}", **place} for index, place in places if place]

    @cached_property
    def transfer(self) -> dict[str, Any] | None:
        """Return range and histogram of the scene's volume; None where it names none, or shows channels."""
        if self._volume is None or any(tf.source != (0, None) for tf in self._volume.tfs.values()):
            return None
        ends = [value for tf in self._volume.tfs.values() for value in tf.support]
        range_of_values, counts = histogram_of(summary_file(self._volume.file))
        low, high = range_of_values or (min(ends, default=0.0), max(ends, default=1.0))
        return {"minimum": low, "maximum": high, "histogram": counts}


def histogram_of(file: Path) -> tuple[tuple[float, float] | None, list[int]]:
    """Return the range of values and the histogram in a volume.json; nothing of a damaged or missing one."""
    try:
        summary = read_json(file)
    except TexgsError as error:
        log.warning("%s; functions are shown without a histogram", error)
        return None, []
    known = summary if isinstance(summary, dict) else {}
    values: list[Any] = [known.get(key) for key in ("minimum", "maximum", "histogram")]
    low, high, counts = values
    if not (isinstance(counts, list) and counts and all(map(is_number, (low, high, *counts)))):
        log.warning("%s: expected a range and a histogram in numbers; functions are shown without", file)
        return None, []
    return (low, high), [int(part.sum()) for part in np.array_split(counts, min(BINS, len(counts)))]


def views_of(scene: Scene) -> dict[str, list[Image]]:
    """Return the training views of models by name. Those that are damaged are left out and logged."""
    whole = {}
    for name, entry in scene.models.items():
        folders = VIEW_FOLDERS if "relight" in kind_of(entry.file).can else VIEW_FOLDERS[::-1]
        found = (find_upwards(entry.file, f"{folder}/transforms_train.json") for folder in folders)
        if file := next(filter(None, found), None):
            try:
                whole[name] = read_views(file.parent).train
            except TexgsError as error:
                log.warning("%s", error)
    return whole


def over(image: Image, background: tuple[float, float, float]) -> np.ndarray:
    """Return the pixels [H, W, 3] of a view over a background, uint8."""
    pixels = image.load().numpy().astype(np.float32)
    alpha = pixels[..., 3:] / 255
    return (alpha * pixels[..., :3] + (1 - alpha) * 255 * np.array(background)).round().astype(np.uint8)


def fitted(pixels: np.ndarray, width: int, height: int) -> np.ndarray:
    """Return a picture [H, W, 3] that fills a frame, with its corner's colour around it."""
    scale = min(width / pixels.shape[1], height / pixels.shape[0])
    size = [max(1, round(scale * side)) for side in pixels.shape[1::-1]]
    small = cv2.resize(pixels, size, interpolation=cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR)
    left, top = (width - size[0]) // 2, (height - size[1]) // 2
    sides = (top, height - size[1] - top, left, width - size[0] - left)
    return cv2.copyMakeBorder(small, *sides, cv2.BORDER_CONSTANT, value=pixels[0, 0].tolist())


def orbit_of(camera: Camera, near: Sequence[float]) -> dict[str, Any] | None:
    """Return the orbit of a camera around what it sees near a place; None if +y is not up."""
    position, forward = camera.position.tolist(), camera.viewmat[2, :3].tolist()
    distance = sum((to - here) * step for to, here, step in zip(near, position, forward, strict=True))
    if not distance > 0:
        return None
    target = [here + distance * step for here, step in zip(position, forward, strict=True)]
    azimuth, polar = degrees(atan2(forward[2], -forward[0])), degrees(asin(max(-1.0, min(1.0, -forward[1]))))
    fov_y = degrees(2 * atan(0.5 * camera.height / float(camera.K[1, 1])))
    again = orbit(azimuth, polar, distance, fov_y, camera.width, camera.height, target)
    if not again.viewmat.allclose(camera.viewmat, atol=CAMERA_TOLERANCE):
        return None
    return {"target": target, "azimuth": azimuth, "polar": polar, "distance": distance, "fov_y": fov_y}
