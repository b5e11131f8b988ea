"""Smoothness of rendered attributes except across the edges of the image."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from texgs.core import check
from texgs.core.errors import ShapeError
from texgs.raster.fused import fused_loss
from texgs.raster.losses_abi import call
from texgs.raster.ssim import planar


def bilateral_smoothness(attribute: Tensor, guide: Tensor, alpha: Tensor) -> Tensor:
    """Bilateral smoothness of attribute maps: mean of alpha * exp(-g(grey)) * g(attribute).

    g = |Sobel x| + |Sobel y|, 3 x 3 and not normalised, zeros outside the image; grey is the mean of the
    guide's channels. An attribute may change where the guide does (Gao et al. 2024; the paper's L_b). Linear
    in the scale of the attribute: an exponent of 0 to 50 counts fifty times as much as a factor of 0 to 1.
    Differentiable in `attribute`.

    Args:
        attribute: [H, W] or [H, W, C] rendered attributes, averaged over channels. Planar memory is not
            copied.
        guide: [H, W, 3] ground-truth image in [0, 1].
        alpha: [H, W] ground-truth alpha in [0, 1].

    Returns:
        [] 0 or more.

    Raises:
        ShapeError, ArgumentError, DeviceError: naming the argument at fault.
    """
    sizes = check.shape("attribute", attribute, "H W" if attribute.ndim == 2 else "H W C")
    if attribute.numel() == 0:
        raise ShapeError(f"attribute: expected at least one pixel, got {list(attribute.shape)}")
    check.shape("guide", guide, "H W 3", **sizes)
    check.shape("alpha", alpha, "H W", **sizes)
    for name, tensor in (("attribute", attribute), ("guide", guide), ("alpha", alpha)):
        check.floating(name, tensor)
    check.same_device(attribute=attribute, guide=guide, alpha=alpha)
    check.constant(guide=guide, alpha=alpha)

    def evaluate(tensors: Sequence[Tensor], wanted: Sequence[bool]) -> tuple[Tensor, list[Tensor | None]]:
        x, *constants = tensors
        value = x.new_empty(())
        gradient = torch.empty_like(x) if wanted[0] else None
        call("texgs_bilateral_smoothness", x, *constants, *x.shape, value, gradient, device=x.device)
        return value, [gradient]

    return fused_loss(evaluate, [planar(attribute)], [planar(guide), alpha.contiguous()])
