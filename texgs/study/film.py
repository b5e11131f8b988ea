"""Film of several scenes that turn in step, each in its cell of one picture; one film cannot fall apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import ceil, sqrt
from pathlib import Path

import numpy as np
import torch

from texgs.core.camera import Camera
from texgs.core.movie import write_frames
from texgs.core.progress import progress
from texgs.scene.frame import frame
from texgs.scene.scene import WHITE, Scene
from texgs.scene.twin import twin_of
from texgs.volume.cameras import orbit_path

POLAR = 20.0  # degrees above the horizon
CRF = 23  # of H.264: half the bytes of a film that is looked at alone, so that the page can be mailed


def cell(index: int, count: int) -> tuple[int, int]:
    """Return the column and row of a scene among so many, in a picture about as wide as high."""
    columns = ceil(sqrt(count))
    return index % columns, index // columns


def write_film(
    path: str | Path, scenes: Sequence[Scene], size: int, frames: int, device: torch.device, title: str
) -> Path:
    """Write one turn around scenes as MP4: the same cameras, background and size, pixels of a cell, for all.

    They show all that is framed of the first scene.
    """
    shown = [
        (scene.open(device), replace(scene, background=WHITE), twin_of(scene, device)) for scene in scenes
    ]

    def draw(camera: Camera) -> list[np.ndarray]:
        return [frame(composition, camera, scene, twin=twin) for composition, scene, twin in shown]

    lens = scenes[0].framed(shown[0][0]).lens().square(size)
    turn = progress(orbit_path(frames, POLAR, *lens), title=title, unit="frame")
    return write_frames(path, (mosaic(draw(camera)) for camera in turn), crf=CRF)


def mosaic(pictures: Sequence[np.ndarray]) -> np.ndarray:
    """Return the pictures [H, W, 3] of one size in their cells; cells without one are white."""
    height, width = pictures[0].shape[:2]
    places = [cell(index, len(pictures)) for index in range(len(pictures))]
    columns, rows = (1 + max(place) for place in zip(*places, strict=True))
    whole = np.full((rows * height, columns * width, 3), 255, dtype=np.uint8)
    for (column, row), picture in zip(places, pictures, strict=True):
        whole[row * height : (row + 1) * height, column * width : (column + 1) * width] = picture
    return whole
