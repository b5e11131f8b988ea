"""The definitions of the image losses in torch and kornia: any floating-point type, gradients by autograd."""

import torch
from torch import Tensor
from torch.nn.functional import normalize, pad

WINDOW = 11  # pixels each way, weighted by a Gaussian of standard deviation 1.5


def similarities(image: Tensor, target: Tensor) -> Tensor:
    """Return the structural similarity around each pixel of [H, W, C] images; see `texgs.raster.losses`."""
    from kornia.metrics import ssim

    x, y = (pad(each.permute(2, 0, 1)[None], (WINDOW // 2,) * 4) for each in (image, target))
    return ssim(x, y, WINDOW, eps=0.0, padding="valid")[0].permute(1, 2, 0)


def ssim(image: Tensor, target: Tensor) -> Tensor:
    """Return the mean structural similarity of [H, W, C] images."""
    return similarities(image, target).mean()


def l1_dssim(image: Tensor, target: Tensor, lambda_dssim: float = 0.2) -> Tensor:
    """Return (1 - lambda) mean |image - target| + lambda (1 - SSIM) of [H, W, C] images."""
    return (1 - lambda_dssim) * (image - target).abs().mean() + lambda_dssim * (1 - ssim(image, target))


def depth_to_normal(depth: Tensor, viewmat: Tensor, K: Tensor) -> Tensor:
    """Return the world normals [H, W, 3] of a depth map [H, W]; see `texgs.raster.losses`."""
    height, width = depth.shape
    y, x = torch.meshgrid(
        torch.arange(height, dtype=depth.dtype, device=depth.device) + 0.5,
        torch.arange(width, dtype=depth.dtype, device=depth.device) + 0.5,
        indexing="ij",
    )
    rays = torch.stack([(x - K[0, 2]) / K[0, 0], (y - K[1, 2]) / K[1, 1], torch.ones_like(x)], -1)
    points = depth[..., None] * rays  # [H, W, 3] camera axes
    along_x = points[1:-1, 2:] - points[1:-1, :-2]
    along_y = points[2:, 1:-1] - points[:-2, 1:-1]
    seen = torch.stack([depth[1:-1, 2:], depth[1:-1, :-2], depth[2:, 1:-1], depth[:-2, 1:-1]]).amin(0) > 0
    facing = torch.where(seen[..., None], torch.linalg.cross(along_y, along_x), 0)
    normal = normalize(facing, dim=-1) @ viewmat[:3, :3]  # the transpose of R_cw, applied to rows
    return pad(normal, (0, 0, 1, 1, 1, 1)) if min(height, width) > 2 else torch.zeros_like(points)


def normal_consistency(normal: Tensor, depth: Tensor, alpha: Tensor, viewmat: Tensor, K: Tensor) -> Tensor:
    """Return the mean over pixels of 1 - alpha * normal . depth_to_normal(depth), alpha without gradient."""
    agreement = (normal * depth_to_normal(depth, viewmat, K)).sum(-1)  # [H, W]
    return (1 - alpha.detach() * agreement).mean()


def bilateral_smoothness(attribute: Tensor, guide: Tensor, alpha: Tensor) -> Tensor:
    """Return the mean of alpha * exp(-g(grey)) * g(attribute); see `texgs.raster.losses`."""
    channels = attribute[None] if attribute.ndim == 2 else attribute.permute(2, 0, 1)  # [C, H, W]
    weight = alpha * torch.exp(-edges(guide.mean(-1)[None]))  # [1, H, W]
    return (weight * edges(channels)).mean()


def edges(planes: Tensor) -> Tensor:
    """Return |d/dx| + |d/dy| of [C, H, W] by Sobel's kernels, zeros outside the image."""
    from kornia.filters import spatial_gradient

    gradient = spatial_gradient(pad(planes[None], (1, 1, 1, 1)))[0]  # [C, 2, H + 2, W + 2]
    size: Tensor = gradient[..., 1:-1, 1:-1].abs().sum(1)
    return size
