"""Pictures of a scene before and after an edit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch

from texgs.core.camera import Camera
from texgs.core.lens import Lens
from texgs.core.light import Light
from texgs.core.movie import write_frames
from texgs.core.progress import progress
from texgs.report.strip import write_strip
from texgs.scene.frame import frame
from texgs.scene.scene import Scene
from texgs.volume.cameras import orbit_path

POLAR = 20.0  # degrees
SHOWN = 3  # views around the object
SIDE = Light("directional", -30.0, 40.0)  # a light that no edit has seen
SIZE = 512  # pixels of a picture
TURN, TURN_SIZE = 36, 320  # frames of the turntable, and pixels of each half


def write_before_and_after(
    before: Scene, after: Scene, lens: Lens, output: Path, device: torch.device, title: str
) -> None:
    """Write edit.png, views of both under the scene's light and under another, and turntable.mp4 of both.

    Args:
        before: the scene.
        after: the same scene, edited.
        lens: of the cameras, but for the size of images.
        output: folder.
        device: that renders.
        title: of the progress bar.
    """
    cameras = orbit_path(SHOWN, POLAR, *lens.square(SIZE))
    lights = [before.light] * SHOWN + [SIDE]
    titles = [f"view {index + 1}" for index in range(SHOWN)] + ["light from the side"]
    scenes = {"before": before, "after": after}
    rows = {name: pictures(scene, [*cameras, cameras[0]], lights, device) for name, scene in scenes.items()}
    write_strip(output / "edit.png", rows, titles)
    turn = orbit_path(TURN, POLAR, *lens.square(TURN_SIZE))
    halves = [pictures(scene, turn, [scene.light] * TURN, device) for scene in scenes.values()]
    frames = [np.concatenate(pair, axis=1) for pair in zip(*halves, strict=True)]
    write_frames(output / "turntable.mp4", progress(frames, title=f"{title}, turntable", unit="frame"))


def pictures(
    scene: Scene, cameras: list[Camera], lights: list[Light], device: torch.device
) -> list[np.ndarray]:
    """Frames [H, W, 3], uint8."""
    composition = scene.open(device)
    return [
        frame(composition, camera, light, scene.edits, background=scene.background)
        for camera, light in zip(cameras, lights, strict=True)
    ]
