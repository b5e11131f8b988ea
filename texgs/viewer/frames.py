"""Frames for pages: rendered one after the other in a thread of their own, as JPEG or PNG.

A scene can be beside its volume, or where it names none, beside the training view nearest to the camera.
"""

import asyncio
import io
import json
import struct
import time
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from ctypes import c_int32
from dataclasses import dataclass, replace
from math import sqrt

import cv2
import numpy as np
import torch
from torch import Tensor

from texgs.core.cuts import NO_CUTS
from texgs.core.errors import ArgumentError
from texgs.core.movie import save_png
from texgs.metrics.quality import compare
from texgs.raster.native import stopped_by
from texgs.report.beside_volume import scale_of
from texgs.report.fit_figure import signed_error
from texgs.scene.frame import quantize
from texgs.scene.scene import Scene
from texgs.scene.session import Session
from texgs.scene.shot import Shot
from texgs.viewer.messages import View
from texgs.viewer.origins import Origins, fitted, over

SLOW_FRAME = 0.025  # seconds; slower frames of what moves have fewer rows and columns
LEAST_SCALE = 1 / 3  # of rows and columns, unless frames still take longer than `SLOWEST_FRAME`
SLOWEST_FRAME = 0.06  # seconds; what is off by less than a fifth still leaves ten frames a second
LEAST_ROWS = 120  # however slow frames are
MOVING_STEPS = dict.fromkeys(("volume", "difference", "wipe"), 0.5)  # voxels between samples, while moving
MOVING_CUT_STEP = 1.0  # the same of faces of cuts
MOVING_JPEG = (75, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_420)
ENLARGED_PIXELS = 300 * 300  # at most, of a picture that a page enlarges: it is cheap to send in good quality
ENLARGED_JPEG = (92, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444)
STILL_JPEG = (95, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444)


@dataclass
class Pace:
    """How long frames of a page take in one mode; it decides on their resolution while something moves."""

    part: float = 1.0  # of the sides of a frame

    def scale(self, moving: bool) -> float:
        """Return the part of the sides of a frame to render."""
        return self.part if moving else 1.0

    def took(self, seconds: float, scale: float, rows: int) -> None:
        """Learn from a frame that has so many rows when it is whole.

        A whole one counts while moving ones are whole as well. What is off by less than a fifth changes
        nothing, so that the sharpness of a drag does not waver.
        """
        fast, slow = (scale * sqrt(each / seconds) for each in (SLOW_FRAME, SLOWEST_FRAME))
        part = min(max(fast, min(slow, LEAST_SCALE), least_scale(rows)), 1.0)
        if scale == self.part and (part == 1 or not 0.8 < part / scale < 1.25):
            self.part = part


def least_scale(rows: int) -> float:
    """Return the least part of the sides of a frame, which whole has so many rows."""
    return min(LEAST_SCALE, LEAST_ROWS / rows)


class Frames:
    """Renders views of a session's scenes in one thread, in the order of requests."""

    def __init__(self, session: Session, beside: "Beside") -> None:
        self._session, self._beside = session, beside
        threads = torch.get_num_threads()
        self._thread = ThreadPoolExecutor(1, "render", torch.set_num_threads, (threads,))

    async def frame(self, view: View, scene: Scene, paces: dict[str, Pace], stop: c_int32) -> bytes:
        """Return a header and a JPEG picture, see `packed`; it takes the pace of its mode, and learns it.

        Another thread may set `stop` meanwhile: then it raises Stopped, unless the frame is as good as done.
        """

        def work() -> bytes:
            rows, start = view.camera.height, time.perf_counter()
            pace = paces.setdefault(view.mode, Pace(least_scale(rows) if view.mode in MOVING_STEPS else 1.0))
            scale = pace.scale(view.moving)
            with stopped_by(stop):
                pixels, scores = self._draw(view, scene, scale)
            seconds = time.perf_counter() - start
            pace.took(seconds, scale, rows)
            return packed(view, pixels, seconds, scores)

        return await asyncio.get_running_loop().run_in_executor(self._thread, work)

    async def still(self, view: View, scene: Scene, comment: str) -> bytes:
        """Return a PNG file with the pixels and the comment that `texgs render` writes."""

        def work() -> bytes:
            file = io.BytesIO()
            save_png(file, self.pixels(view, scene), comment)
            return file.getvalue()

        return await asyncio.get_running_loop().run_in_executor(self._thread, work)

    async def point_at(self, view: View, scene: Scene, pixel: tuple[int, int]) -> list[float] | None:
        """Return the point of the scene that a pixel of a view shows; None for the background."""
        camera = view.camera.camera()
        return await asyncio.to_thread(self._session.point_at, camera, view.mode, scene, pixel)

    def pixels(self, view: View, scene: Scene) -> np.ndarray:
        """Return what a view shows [H, W, 3 or 4], uint8, and the scene's markers on it: for files."""
        if view.mode == "truth" or view.mode == "difference" or view.mode == "wipe":
            return self._draw(view, scene, 1.0)[0]
        shot = Shot(mode=view.mode, transparent=view.transparent, legend=view.legend)
        return self._session.picture(view.camera.camera(), shot, scene)

    def close(self) -> None:
        """End the thread after the frame that it renders."""
        self._thread.shutdown(wait=True, cancel_futures=True)

    def _draw(self, view: View, scene: Scene, scale: float) -> tuple[np.ndarray, dict[str, float]]:
        """Return what a view shows, with scaled sides, and its scores."""
        step = MOVING_STEPS.get(view.mode, MOVING_CUT_STEP) if view.moving else None
        if view.mode == "truth" or view.mode == "difference" or view.mode == "wipe":
            return self._beside.frame(view, scene, scale, step)
        camera, transparent = view.camera.camera(scale), view.transparent
        return self._session.frame(camera, view.mode, scene, step, transparent=transparent), {}


def packed(view: View, pixels: np.ndarray, seconds: float, scores: Mapping[str, float]) -> bytes:
    """Return the length of a header (4 bytes, little-endian), the header (JSON), a JPEG picture."""
    rows, columns, _ = pixels.shape
    quality, sampling = (
        (ENLARGED_JPEG if rows * columns <= ENLARGED_PIXELS else MOVING_JPEG) if view.moving else STILL_JPEG
    )
    options = [cv2.IMWRITE_JPEG_QUALITY, quality, cv2.IMWRITE_JPEG_SAMPLING_FACTOR, sampling]
    _, picture = cv2.imencode(".jpg", cv2.cvtColor(pixels[..., :3], cv2.COLOR_RGB2BGR), options)
    header = json.dumps({"id": view.id, "ms": round(1000 * seconds, 1), **scores}).encode()
    return struct.pack("<I", len(header)) + header + picture.tobytes()


class Beside:
    """Shows what a scene is compared with, by how much it differs, or both with a line between them."""

    def __init__(self, session: Session, origins: Origins) -> None:
        self._session, self._origins = session, origins

    @property
    def modes(self) -> list[str]:
        """Return the modes of comparison that the session's scene has."""
        if self._session.scene.volume is not None:
            return ["volume", "difference", "wipe"]
        return ["truth", "difference"] if self._origins.has_views else []

    def frame(
        self, view: View, scene: Scene, scale: float, step: float | None = None
    ) -> tuple[np.ndarray, dict[str, float]]:
        """Return a frame [H, W, 3], uint8, and at rest how close scene and volume are in it.

        Nothing is told of a cut scene that shows its volume itself.

        A training view is in the middle of the frame, has its own light, and knows no cuts.
        """
        camera = view.camera.camera(scale)
        if scene.volume is not None:
            image, truth = self._session.beside(camera, scene, step)
            says_nothing = view.moving or scene.shows_volume
            return comparison(view, image.color, truth.color), {} if says_nothing else compare(image, truth)
        if view.mode == "wipe":
            raise ArgumentError("wipe: expected a scene that names its volume; make it by texgs compose")
        nearest = self._origins.nearest(camera, scene)
        plain = replace(scene, light=nearest.light, cuts=NO_CUTS)
        pair = (self._session.frame(nearest.camera, "shaded", plain), over(nearest, scene.background))
        seen, expected = (torch.from_numpy(each) / 255 for each in pair)
        return fitted(comparison(view, seen, expected), camera.width, camera.height), {}


def comparison(view: View, image: Tensor, truth: Tensor) -> np.ndarray:
    """Return what a view shows of two pictures [H, W, 3], uint8.

    A difference is that of the worst channel: red where the scene is too bright, blue where it is too dark.
    """
    picture, width = truth, image.shape[1]
    if view.mode == "difference":
        picture = scale_of(view.gain)(signed_error(image, truth))
    elif view.mode == "wipe":
        left, right = (width, 0) if view.wipe is None else [round(view.wipe * width)] * 2
        picture = torch.cat([image[:, :left], truth[:, right:]], dim=1)
    return quantize(picture)
