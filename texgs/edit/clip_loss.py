"""How far the overall look of an image is from that of a style picture, by CLIP."""

from __future__ import annotations

import torch
from torch import Tensor

from texgs.core import check
from texgs.models.clip import Clip


class ClipLoss:
    """|C(R) - C(S)|, the distance of unit features of whole images; those of the style are computed once.

    It is the second term of the paper's loss for image-driven editing.

    Args:
        clip: the backbone.
        style: [H, W, 3] in [0, 1].

    Raises:
        ShapeError: if the style is no image.
    """

    def __init__(self, clip: Clip, style: Tensor) -> None:
        check.shape("style", style, "H W 3")
        self.clip = clip
        with torch.no_grad():
            self.target = clip.images(style[None])

    def __call__(self, image: Tensor) -> Tensor:
        """The loss of an image [H, W, 3] in [0, 1], a scalar; differentiable in it."""
        check.shape("image", image, "H W 3")
        return (self.clip.images(image[None]) - self.target).norm()
