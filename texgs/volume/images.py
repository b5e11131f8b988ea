"""The views of a split in memory over white, 8 bits per value, and one of them at a time as floats."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, Self

import cv2
import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import avg_pool2d

from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.core.light import Light
from texgs.core.memory import require_memory
from texgs.volume.view_set import View

BYTES_PER_PIXEL = 64  # of memory for a pixel of a view that is being read
MARGIN = 11  # pixels; a window of SSIM, so that windows near content end in white


class PixelBox(NamedTuple):
    """The part of a view in which anything can be seen: pixels left <= x < right, top <= y < bottom.

    It is all that a loss needs to look at. Outside of it image and target are white, and gradients have
    nothing to add; nor have losses, but for the normal consistency, which is a constant there. An object in
    the middle of the view fills a third of it, and a step takes a third of the memory traffic.
    """

    left: int
    top: int
    right: int
    bottom: int

    def union(self, other: "PixelBox") -> "PixelBox":
        """Return the smallest box around both."""
        low, high = map(min, self[:2], other[:2]), map(max, self[2:], other[2:])
        return PixelBox(*low, *high)

    def within(self, width: int, height: int) -> "PixelBox":
        """Return the box with a margin, clipped to the image, at least one pixel."""
        left = min(max(self.left - MARGIN, 0), width - 1)
        top = min(max(self.top - MARGIN, 0), height - 1)
        right = max(min(self.right + MARGIN, width), left + 1)
        return PixelBox(left, top, right, max(min(self.bottom + MARGIN, height), top + 1))


@dataclass(frozen=True, eq=False)
class Target:
    """One view to fit."""

    color: Tensor  # [H, W, 3] over white, planar memory
    alpha: Tensor  # [H, W]
    camera: Camera
    light: Light
    share: float = 1.0  # of the view's pixels, for a crop


@dataclass(frozen=True, eq=False)
class Images:
    """Views of one size: colour over white and alpha."""

    planes: Tensor  # [V, 4, H, W] uint8
    cameras: list[Camera]
    lights: list[Light]

    def __len__(self) -> int:
        return len(self.planes)

    def __getitem__(self, some: slice) -> Self:
        return replace(self, planes=self.planes[some], cameras=self.cameras[some], lights=self.lights[some])

    @cached_property
    def boxes(self) -> list[PixelBox]:
        """Return for each view the pixels that are not white."""
        with ThreadPoolExecutor() as pool:
            return list(pool.map(content_box, self.planes.numpy()))

    @property
    def size(self) -> tuple[int, int]:
        """Return width and height in pixels."""
        return self.planes.shape[3], self.planes.shape[2]

    def target(
        self, index: int, device: torch.device | str = "cpu", around: PixelBox | None = None
    ) -> Target:
        """Return one view as floats: of `around` and all that is not white, or by default the whole."""
        planes, camera, whole = self.planes[index], self.cameras[index], PixelBox(0, 0, *self.size)
        box = whole if around is None else self.boxes[index].union(around).within(*self.size)
        if box != whole:
            planes, camera = planes[:, box.top : box.bottom, box.left : box.right], camera.crop(*box)
        planes = planes.to(device) / 255
        share = camera.width * camera.height / (whole.right * whole.bottom)
        return Target(planes[:3].permute(1, 2, 0), planes[3], camera.to(device), self.lights[index], share)


def load(views: Sequence[View], reduce: int = 1) -> Images:
    """Read all images of views of one size and lens.

    Every block of reduce x reduce pixels becomes one, the average of premultiplied colours.
    """
    height, width = views[0].camera.height, views[0].camera.width
    if height % reduce or width % reduce:
        raise ArgumentError(f"reduce: expected a divisor of {width} x {height} pixels, got {reduce}")
    threads = torch.get_num_threads()
    pixels = (
        4 * len(views) * (height // reduce) * (width // reduce) + BYTES_PER_PIXEL * height * width * threads
    )
    require_memory(pixels, f"{len(views)} views of {width} x {height} pixels", "raise fit.reduce")
    planes = torch.empty(len(views), 4, height // reduce, width // reduce, dtype=torch.uint8)

    def read(index: int) -> None:
        planes[index] = over_white(views[index], reduce).mul_(255).round_().to(torch.uint8)

    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(read, range(len(views))))
    return Images(planes, [smaller(view.camera, reduce) for view in views], [view.light for view in views])


def over_white(view: View, reduce: int = 1) -> Tensor:
    """Return colour over white and alpha [4, H, W], float32.

    On one thread, and without torch: views are read by several threads, or beside the work on another one.
    """
    planes = np.ascontiguousarray(view.load().numpy().transpose(2, 0, 1)).astype(np.float32)
    planes /= 255
    planes[:3] *= planes[3]
    if reduce > 1:
        height, width = planes.shape[1] // reduce, planes.shape[2] // reduce
        planes = np.stack(
            [cv2.resize(plane, (width, height), interpolation=cv2.INTER_AREA) for plane in planes]
        )
    planes[:3] += 1 - planes[3]
    return torch.from_numpy(planes)


def smaller(camera: Camera, reduce: int) -> Camera:
    """Return the camera of an image reduced by averaging."""
    K = camera.K.clone()
    K[:2] /= reduce
    return replace(camera, K=K, width=camera.width // reduce, height=camera.height // reduce)


def shrink(images: Images, factor: int) -> Images:
    """Average factor x factor pixels; incomplete blocks at the right and bottom are cut off."""
    if factor <= 1:
        return images
    planes = torch.stack([avg_pool2d(view.float(), factor).round().to(torch.uint8) for view in images.planes])
    return Images(planes, [smaller(camera, factor) for camera in images.cameras], images.lights)


def content_box(planes: np.ndarray) -> PixelBox:
    """Return the pixels of an image over white and its alpha [4, H, W], uint8, that are not plain white."""
    seen = (planes[:3].min(axis=0) < 255) | (planes[3] > 0)
    if not seen.any():
        middle_y, middle_x = (size // 2 for size in seen.shape)
        return PixelBox(middle_x, middle_y, middle_x, middle_y)
    columns, rows = np.flatnonzero(seen.any(axis=0)), np.flatnonzero(seen.any(axis=1))
    return PixelBox(int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1)
