"""How far the overall look of an image is from that of a style picture, by CLIP."""

from __future__ import annotations

from typing import Literal

import torch
from torch import Tensor
from torch.nn import functional as F

from texgs.core import check
from texgs.core.errors import ArgumentError
from texgs.models.clip import Clip

CUTOUTS = 16  # of the release


class ClipLoss:
    """Loss of an image against a style picture, whose features are computed once.

    "whole": |C(R) - C(S)|, the Euclidean distance of unit features of whole images (the second term of the
    paper's loss for image-driven editing). "cutouts": what the paper's released code does, the mean of
    2 asin(|C(r) - C(S)| / 2)^2 over random square parts r of the image, against the middle of the style.

    Args:
        clip: the backbone.
        style: [H, W, 3] in [0, 1].
        kind: of the loss.
        generator: of the parts; seeded, it gives the same ones again. On the CPU.
        cutouts: number of parts.

    Raises:
        ArgumentError, ShapeError: if the style is no image, or the kind is unknown.
    """

    def __init__(
        self,
        clip: Clip,
        style: Tensor,
        kind: Literal["whole", "cutouts"] = "whole",
        generator: torch.Generator | None = None,
        cutouts: int = CUTOUTS,
    ) -> None:
        check.shape("style", style, "H W 3")
        if kind not in ("whole", "cutouts") or cutouts < 1:
            raise ArgumentError(f"kind: expected whole, or cutouts of which there are some, got {kind}")
        self.clip, self.kind, self.cutouts = clip, kind, cutouts
        self.generator = torch.Generator().manual_seed(0) if generator is None else generator
        with torch.no_grad():
            self.target = clip.images((style if kind == "whole" else middle(style))[None])

    def __call__(self, image: Tensor) -> Tensor:
        """The loss of an image [H, W, 3] in [0, 1], a scalar; differentiable in it."""
        check.shape("image", image, "H W 3")
        if self.kind == "whole":
            return (self.clip.images(image[None]) - self.target).norm()
        distances = (self.clip.encoded(self._parts(image)) - self.target).norm(dim=1)
        # Beyond 2 rounding could leave the domain of asin; its slope there is infinite.
        return (2 * (distances / 2).clamp_max(1 - 1e-6).asin().square()).mean()

    def _parts(self, image: Tensor) -> Tensor:
        """Random squares of an image as the encoder takes them [P, 3, S, S]."""
        height, width = image.shape[:2]
        longest = min(height, width)
        shortest = min(self.clip.size, longest)
        squares = []
        for _ in range(self.cutouts):
            side = self._random(shortest, longest)
            top, left = self._random(0, height - side), self._random(0, width - side)
            part = image[top : top + side, left : left + side].permute(2, 0, 1)
            squares.append(F.adaptive_avg_pool2d(part, self.clip.size))
        return self.clip.prepared(torch.stack(squares).permute(0, 2, 3, 1))

    def _random(self, low: int, high: int) -> int:
        """A whole number from low to high, both possible."""
        return int(torch.randint(low, high + 1, (1,), generator=self.generator))


def middle(image: Tensor) -> Tensor:
    """The largest square [S, S, 3] in the middle of an image."""
    height, width = image.shape[:2]
    side = min(height, width)
    top, left = (height - side) // 2, (width - side) // 2
    return image[top : top + side, left : left + side]
