"""The views of a split in memory, 8 bits per value, and one of them at a time as floats."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.volume.reduced import over_white, smaller
from texgs.volume.view_set import Light, View


@dataclass(frozen=True, eq=False)
class Target:
    """One view to fit."""

    color: Tensor  # [H, W, 3] over white, planar memory
    alpha: Tensor  # [H, W]
    camera: Camera
    light: Light


@dataclass(frozen=True, eq=False)
class Images:
    """Views of one size: colour over white and alpha."""

    planes: Tensor  # [V, 4, H, W] uint8
    cameras: list[Camera]
    lights: list[Light]

    def __len__(self) -> int:
        return len(self.planes)

    def target(self, index: int, device: torch.device | str = "cpu") -> Target:
        """One view as floats on a device."""
        planes = self.planes[index].to(device).float().div_(255)
        return Target(
            planes[:3].permute(1, 2, 0), planes[3], self.cameras[index].to(device), self.lights[index]
        )


def load(views: Sequence[View], reduce: int = 1) -> Images:
    """Read all images.

    Args:
        views: of one size and lens.
        reduce: every block of reduce x reduce pixels becomes one, the average of premultiplied colours.

    Raises:
        ArgumentError: if there is no view, or the size cannot be divided.
    """
    if not views:
        raise ArgumentError("views: expected at least one, got none")
    height, width = views[0].camera.height, views[0].camera.width
    if height % reduce or width % reduce:
        raise ArgumentError(f"reduce: expected a divisor of {width} x {height} pixels, got {reduce}")
    planes = torch.empty(len(views), 4, height // reduce, width // reduce, dtype=torch.uint8)

    def read(index: int) -> None:
        planes[index] = over_white(views[index], reduce).mul_(255).round_().to(torch.uint8)

    with ThreadPoolExecutor() as pool:
        list(pool.map(read, range(len(views))))
    return Images(planes, [smaller(view.camera, reduce) for view in views], [view.light for view in views])
