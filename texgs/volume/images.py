"""The views of a split in memory, 8 bits per value, and one of them at a time as floats."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.core.light import Light
from texgs.core.memory import require_memory
from texgs.volume.boxes import Box, content_box
from texgs.volume.reduced import over_white, smaller
from texgs.volume.view_set import View

BYTES = 64  # of memory for a pixel of a view that is being read


@dataclass(frozen=True, eq=False)
class Target:
    """One view to fit."""

    color: Tensor  # [H, W, 3] over white, planar memory
    alpha: Tensor  # [H, W]
    camera: Camera
    light: Light
    share: float = 1.0  # of all pixels of the view, where this is a part of it


@dataclass(frozen=True, eq=False)
class Images:
    """Views of one size: colour over white and alpha."""

    planes: Tensor  # [V, 4, H, W] uint8
    cameras: list[Camera]
    lights: list[Light]

    def __len__(self) -> int:
        return len(self.planes)

    @cached_property
    def boxes(self) -> list[Box]:
        """For each view the pixels that are not white."""
        with ThreadPoolExecutor() as pool:
            return list(pool.map(content_box, self.planes.numpy()))

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        return self.planes.shape[3], self.planes.shape[2]

    def target(self, index: int, device: torch.device | str = "cpu", around: Box | None = None) -> Target:
        """One view as floats on a device.

        Args:
            index: of the view.
            device: of the tensors.
            around: only the part that holds these pixels and all that is not white; by default the whole.
        """
        planes, camera, share = self.planes[index], self.cameras[index], 1.0
        if around is not None:
            box = self.boxes[index].union(around).within(*self.size)
            planes = planes[:, box.top : box.bottom, box.left : box.right]
            camera, share = camera.crop(*box), planes[0].numel() / self.planes[0, 0].numel()
        planes = planes.to(device).float().div_(255)
        color = planes[:3].permute(1, 2, 0)
        return Target(color, planes[3], camera.to(device), self.lights[index], share)


def load(views: Sequence[View], reduce: int = 1) -> Images:
    """Read all images.

    Args:
        views: of one size and lens.
        reduce: every block of reduce x reduce pixels becomes one, the average of premultiplied colours.

    Raises:
        ArgumentError: if there is no view, or the size cannot be divided.
        OutOfMemoryError: if the views would not fit into memory.
    """
    if not views:
        raise ArgumentError("views: expected at least one, got none")
    height, width = views[0].camera.height, views[0].camera.width
    if height % reduce or width % reduce:
        raise ArgumentError(f"reduce: expected a divisor of {width} x {height} pixels, got {reduce}")
    threads = torch.get_num_threads()
    pixels = 4 * len(views) * (height // reduce) * (width // reduce) + BYTES * height * width * threads
    require_memory(pixels, f"{len(views)} views of {width} x {height} pixels", "raise fit.reduce")
    planes = torch.empty(len(views), 4, height // reduce, width // reduce, dtype=torch.uint8)

    def read(index: int) -> None:
        planes[index] = over_white(views[index], reduce).mul_(255).round_().to(torch.uint8)

    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(read, range(len(views))))
    return Images(planes, [smaller(view.camera, reduce) for view in views], [view.light for view in views])
