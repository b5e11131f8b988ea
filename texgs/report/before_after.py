"""Pictures of a scene before and after an edit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import torch

from texgs.core.camera import Camera
from texgs.core.figures import write_grid
from texgs.core.lens import Lens
from texgs.core.light import Light
from texgs.core.movie import write_frames
from texgs.core.progress import progress
from texgs.fields.kinds import Kind
from texgs.scene.frame import frame
from texgs.scene.scene import Scene
from texgs.volume.cameras import orbit_path

POLAR = 20.0  # degrees
SHOWN = 3  # views around the object
SIDE = Light("directional", -30.0, 40.0)  # a light that no edit has seen
SIZE = 512  # pixels of a picture
TURN = 36  # frames of the turntable


def write_before_and_after(
    before: Scene, after: Scene, kind: Kind, lens: Lens, output: Path, device: torch.device, title: str
) -> None:
    """Write edit.png, views of both, also under another light where they can be relit, and turntable.mp4.

    Args:
        before: the scene.
        after: the same scene, edited.
        kind: of its fields.
        lens: of the cameras, but for the size of images.
        output: folder.
        device: that renders.
        title: of the progress bars.
    """
    cameras = orbit_path(SHOWN, POLAR, *lens.square(SIZE))
    lights, titles = [before.light] * SHOWN, [f"view {index + 1}" for index in range(SHOWN)]
    if "relight" in kind.can:
        cameras, lights, titles = [*cameras, cameras[0]], [*lights, SIDE], [*titles, "light from the side"]
    scenes = {"before": before, "after": after}
    rows = {}
    for name, scene in scenes.items():
        shown = pictures(scene, cameras, lights, device)
        rows[name] = list(progress(shown, len(cameras), title=f"{title}, {name}", unit="picture"))
    write_grid(output / "edit.png", rows, titles)
    turn = orbit_path(TURN, POLAR, *lens.square(kind.film_size))
    halves = [pictures(scene, turn, [scene.light] * TURN, device) for scene in scenes.values()]
    frames = (np.concatenate(pair, axis=1) for pair in zip(*halves, strict=True))
    write_frames(output / "turntable.mp4", progress(frames, TURN, title=f"{title}, turntable", unit="frame"))


def pictures(
    scene: Scene, cameras: Sequence[Camera], lights: Sequence[Light], device: torch.device
) -> Iterator[np.ndarray]:
    """Yield frames [H, W, 3], uint8, as they are rendered."""
    composition = scene.open(device)
    for camera, light in zip(cameras, lights, strict=True):
        yield frame(composition, camera, light, scene.edits, background=scene.background)
