"""How alike images are: PSNR and SSIM as the tables define them."""

from __future__ import annotations

from torch import Tensor

from texgs.raster.losses import ssim as structural_similarity

BEST = 100.0  # dB, of equal images


def psnr(image: Tensor, target: Tensor) -> float:
    """Peak signal-to-noise ratio in dB of images in [0, 1]: the full frame, all channels; 100 if equal.

    Args:
        image: [H, W, C], clamped to [0, 1].
        target: the same shape.
    """
    from kornia.metrics import psnr as of_unit_range

    return min(of_unit_range(image.clamp(0, 1), target, 1.0).item(), BEST)  # NaN stays NaN


def ssim(image: Tensor, target: Tensor) -> float:
    """Structural similarity; see `texgs.raster.losses.ssim`."""
    return structural_similarity(image.clamp(0, 1), target).item()
