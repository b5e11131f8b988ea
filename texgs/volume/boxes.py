"""The part of a view in which anything can be seen: all that a loss needs to look at.

Outside of it image and target are white, and gradients have nothing to add; nor have losses, but for the
normal consistency, which is a constant there. An object in the middle of the view fills a third of it, and a
step takes a third of the memory traffic.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

MARGIN = 11  # pixels: a window of SSIM, so that those of pixels near content end in white


class Box(NamedTuple):
    """Pixels left <= x < right, top <= y < bottom."""

    left: int
    top: int
    right: int
    bottom: int

    def union(self, other: Box) -> Box:
        """The smallest box around both."""
        low, high = map(min, self[:2], other[:2]), map(max, self[2:], other[2:])
        return Box(*low, *high)

    def within(self, width: int, height: int) -> Box:
        """The box and a margin, as far as they are in the image; one pixel of it at least."""
        left = min(max(self.left - MARGIN, 0), width - 1)
        top = min(max(self.top - MARGIN, 0), height - 1)
        right = max(min(self.right + MARGIN, width), left + 1)
        return Box(left, top, right, max(min(self.bottom + MARGIN, height), top + 1))


def content_box(planes: np.ndarray) -> Box:
    """The pixels of an image over white and its alpha [4, H, W], uint8, that are not plain white."""
    seen = (planes[:3].min(axis=0) < 255) | (planes[3] > 0)
    if not seen.any():
        middle_y, middle_x = (size // 2 for size in seen.shape)
        return Box(middle_x, middle_y, middle_x, middle_y)
    columns, rows = np.flatnonzero(seen.any(axis=0)), np.flatnonzero(seen.any(axis=1))
    return Box(int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1)
