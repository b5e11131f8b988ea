"""Errors of images as colours: red where an image is too bright, blue where it is too dark."""

from __future__ import annotations

from torch import Tensor

from texgs.report.figure_page import Scale

MAGNIFIED = 4  # a quarter of the range of colours has the full colour
DIVERGING = "bwr"  # 0 is white
ERROR = Scale(-1 / MAGNIFIED, 1 / MAGNIFIED, DIVERGING)


def signed_error(image: Tensor, target: Tensor) -> Tensor:
    """Of the channel that is farthest off, [H, W]; above 0 where the image is too bright."""
    error = image - target
    return error.gather(2, error.abs().argmax(dim=2, keepdim=True))[..., 0]
