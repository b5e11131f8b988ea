"""How close images are to those that an edit wants: L1, D-SSIM and LPIPS, each with its weight."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from texgs.core.errors import ArgumentError
from texgs.edit.objective import LOSS_SCALE
from texgs.models.lpips import Lpips
from texgs.raster.losses import l1_dssim


@dataclass(frozen=True, eq=False)
class Closeness:
    """A loss on images.

    Raises:
        ArgumentError: if a weight is below 0, all are 0, or LPIPS has one but no network.
    """

    l1: float = 0.8
    dssim: float = 0.2
    lpips: float = 0.0
    network: Lpips | None = None

    def __post_init__(self) -> None:
        weights = self.l1, self.dssim, self.lpips
        if min(weights) < 0 or not any(weights):
            raise ArgumentError(
                f"l1, dssim, lpips: expected weights of 0 or more and one above, got {weights}"
            )
        if self.lpips and self.network is None:
            raise ArgumentError("network: expected one for LPIPS, got none; set the weight of lpips to 0")

    def __call__(self, image: Tensor, wanted: Tensor) -> Tensor:
        """Weighted sum of mean differences [], differentiable in the image.

        Args:
            image: [H, W, 3], planar memory; or patches [N, H, W, 3] where D-SSIM has no weight.
            wanted: the same shape.
        """
        pixels = self.l1 + self.dssim
        loss = image.new_zeros(())
        if self.dssim:
            loss = pixels * l1_dssim(image, wanted, self.dssim / pixels)
        elif self.l1:
            loss = self.l1 * (image - wanted).abs().mean()
        if self.lpips and self.network is not None:
            loss = loss + self.lpips * self.network.distance(image, wanted)
        return loss


def differentiated(closeness: Closeness, image: Tensor, wanted: Tensor) -> tuple[float, Tensor]:
    """The loss, and its gradient by the image, of the image's shape."""
    leaf = image.detach().requires_grad_()
    loss = closeness(leaf, wanted)
    (gradient,) = torch.autograd.grad(LOSS_SCALE * loss, leaf)
    return float(loss.detach()), gradient / LOSS_SCALE
