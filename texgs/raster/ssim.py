"""Structural similarity, and the photometric loss of 3DGS: L1 and D-SSIM in one pass."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from texgs.core import check
from texgs.core.errors import ArgumentError, ShapeError
from texgs.raster.fused import fused_loss
from texgs.raster.losses_abi import call


def ssim(image: Tensor, target: Tensor) -> Tensor:
    """Mean structural similarity of two images with values in [0, 1].

    Gaussian window of 11 x 11 pixels with sigma 1.5, zeros outside the image, C1 = 0.01^2, C2 = 0.03^2,
    averaged over pixels and channels (Wang et al. 2004, with the window and padding of 3DGS). Windows in
    which both images are equal cost almost nothing. Differentiable in `image`; for a loss take `l1_dssim`,
    which is one pass less.

    Args:
        image: [H, W, C] or [H, W]. Planar memory ([C, H, W] seen as [H, W, C], as the rasterizer returns) is
            not copied.
        target: the same shape.

    Returns:
        [] between -1 and 1; exactly 1 for equal images.

    Raises:
        ShapeError, ArgumentError, DeviceError: naming the argument at fault.
    """
    return 1.0 - _weighted(image, target, 0.0, 1.0)


def l1_dssim(image: Tensor, target: Tensor, lambda_dssim: float = 0.2) -> Tensor:
    """Photometric loss (1 - lambda) mean |image - target| + lambda (1 - SSIM) (Kerbl et al. 2023, eq. 7).

    Differentiable in `image`; pixels equal to the target have no L1 gradient. SSIM is that of `ssim`. Alpha
    is a second image: add `weight * l1_dssim(alpha, target_alpha)`.

    Args:
        image: [H, W, C] or [H, W], values in [0, 1]. Planar memory is not copied.
        target: the same shape.
        lambda_dssim: in [0, 1].

    Returns:
        [] 0 or more; exactly 0 for equal images.

    Raises:
        ShapeError, ArgumentError, DeviceError: naming the argument at fault.
    """
    if not 0.0 <= lambda_dssim <= 1.0:
        raise ArgumentError(f"lambda_dssim: expected 0 to 1, got {lambda_dssim}")
    return _weighted(image, target, 1.0 - lambda_dssim, lambda_dssim)


def planar(image: Tensor) -> Tensor:
    """[H, W, C] or [H, W] as dense [C, H, W]; no copy where the memory is laid out so."""
    return (image[None] if image.ndim == 2 else image.permute(2, 0, 1)).contiguous()


def _weighted(image: Tensor, target: Tensor, l1: float, dssim: float) -> Tensor:
    """l1 * mean |image - target| + dssim * (1 - SSIM), checked."""
    check.shape("image", image, "H W" if image.ndim == 2 else "H W C")
    if target.shape != image.shape:
        raise ShapeError(f"target: expected {list(image.shape)} as image, got {list(target.shape)}")
    if image.numel() == 0:
        raise ShapeError(f"image: expected at least one pixel, got {list(image.shape)}")
    check.floating("image", image)
    check.floating("target", target)
    check.same_device(image=image, target=target)
    check.constant(target=target)

    def evaluate(tensors: Sequence[Tensor], wanted: Sequence[bool]) -> tuple[Tensor, list[Tensor | None]]:
        x, dense_target = tensors
        value = x.new_empty(())
        gradient = torch.empty_like(x) if wanted[0] else None
        call("texgs_l1_dssim", x, dense_target, *x.shape, l1, dssim, value, gradient, device=x.device)
        return value, [gradient]

    return fused_loss(evaluate, [planar(image)], [planar(target)])
