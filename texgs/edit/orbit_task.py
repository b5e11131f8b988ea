"""Edits that learn from new views around a scene: where there are no training views at hand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import torch

from texgs.core.camera import Camera, orbit
from texgs.edit.keys import EditKeys
from texgs.edit.method import method_of
from texgs.edit.task import Task
from texgs.scene.scene import Scene
from texgs.volume.cameras import icosphere_of
from texgs.volume.view_set import View

VIEWS, SIZE = 92, 400  # that parts learn from, and pixels of their sides


@dataclass(frozen=True, eq=False)
class OrbitTask(Task[Any]):
    """An edit that learns from new views around the scene, under its light: training views are not needed."""

    side: tuple[float, float] | None = None  # azimuth and polar angle of the only view; None: from all

    def training_views(self, model: str) -> Sequence[View]:
        """Return the cameras on a sphere; there are no images."""
        return [View(camera, Path(), self.scene.light) for camera in self._cameras]

    @cached_property
    def _cameras(self) -> list[Camera]:
        """Return the same ones for all parts."""
        if self.side:
            azimuth, polar = self.side
            return [orbit(azimuth, polar, *self.lens)]
        return icosphere_of(VIEWS, self.lens)


def orbit_task(
    scene: Scene, edit: EditKeys, output: Path, device: torch.device, side: tuple[float, float] | None = None
) -> OrbitTask:
    """Return the task of an edit, which writes its files to a folder."""
    lens = scene.framed().lens().square(SIZE)
    settings = method_of(edit).of(edit)
    return OrbitTask(settings, edit, scene, {}, output, device, 1, lens, "look", side=side)
