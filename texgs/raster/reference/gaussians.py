"""The definition of 3D Gaussians (Kerbl et al. 2023, 3DGS): ellipses on screen by EWA splatting.

The perspective projection is linearised at the mean (Zwicker et al. 2002): a Gaussian projects to a Gaussian
in the image, with the depth of its mean everywhere.
"""

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from texgs.core.geometry import quats_to_matrices
from texgs.raster.reference.fragments import Fragments, alpha_of, depth_order, half_extents, largest_rho
from texgs.raster.types import Options

MARGIN = 0.3  # share of half the field of view; farther outside, the derivative is taken at the edge
MIN_RATIO = 2.5e-5  # of squared areas without and with the dilation; bounds the gradient, as in 3DGS


@dataclass(frozen=True)
class Projected:
    """The M Gaussians that a view keeps, front to back."""

    index: Tensor  # [M] position among the N inputs
    opacity: Tensor  # [M] with the factor of the antialiased variant
    depth: Tensor  # [M] camera z of the mean
    centre: Tensor  # [M, 2] pixel of the mean
    covariance: Tensor  # [M, 2, 2] px^2, dilated


def project(
    means: Tensor,
    quats: Tensor,
    scales: Tensor,
    opacities: Tensor,
    viewmat: Tensor,
    K: Tensor,
    shift: Tensor | None,
    size: tuple[int, int],
    options: Options,
) -> Projected:
    """Keep the Gaussians beyond the near plane that can be seen at all, sort them by depth, project them."""
    R_cw, t_cw = viewmat[:3, :3], viewmat[:3, 3]
    index = depth_order(means @ R_cw[2] + t_cw[2], opacities, options)
    mean = means[index] @ R_cw.T + t_cw  # [M, 3] camera axes
    axes = R_cw @ quats_to_matrices(quats[index]) * scales[index][:, None, :]  # [M, 3, 3] columns
    on_screen = derivative(mean, K, size) @ axes  # [M, 2, 3]
    covariance = on_screen @ on_screen.mT  # [M, 2, 2]
    dilated = covariance + options.dilation * torch.eye(2).to(covariance)
    opacity = opacities[index]
    if options.antialiased:
        opacity = opacity * (area(covariance) / area(dilated)).clamp(min=MIN_RATIO).sqrt()
    centre = (mean @ K.T)[:, :2] / mean[:, 2:]
    if shift is not None:
        centre = centre + shift[index]
    return Projected(index, opacity, mean[:, 2], centre, dilated)


def area(covariance: Tensor) -> Tensor:
    """Return the determinants [M] of symmetric [M, 2, 2]: squared areas of their ellipses over pi^2."""
    return covariance[:, 0, 0] * covariance[:, 1, 1] - covariance[:, 0, 1] ** 2


def derivative(mean: Tensor, K: Tensor, size: tuple[int, int]) -> Tensor:
    """Return the derivative [N, 2, 3] of the pixel by the camera point, at points [N, 3].

    Far outside of the view it grows without bound. There it is taken at the edge of a field of view wider by
    MARGIN, as in 3DGS.
    """
    focal, principal = K.diagonal()[:2], K[:2, 2]
    extent = torch.tensor(size).to(K)
    low, high = -principal / focal, (extent - principal) / focal
    margin = MARGIN * extent / (2 * focal)
    slope = torch.clamp(mean[:, :2] / mean[:, 2:], low - margin, high + margin)
    J = torch.cat([torch.eye(2).to(mean).expand(len(mean), 2, 2), -slope[:, :, None]], 2)
    return J * (focal / mean[:, 2:])[:, :, None]


def intersect(gaussians: Projected, pixels: Tensor, options: Options) -> Fragments:
    """Whiten the distance of each pixel [P, 2] from the centre of each Gaussian."""
    offset = pixels[:, None, :] - gaussians.centre  # [P, M, 2]
    xx, xy, yy = (gaussians.covariance[:, i, j] for i, j in ((0, 0), (0, 1), (1, 1)))
    v = offset[..., 1] / yy.sqrt()
    u = (offset[..., 0] - xy / yy * offset[..., 1]) / (xx - xy**2 / yy).sqrt()
    depth = gaussians.depth.expand_as(u)
    return Fragments(u, v, depth, alpha_of(gaussians.opacity, u**2 + v**2, options))


def visible_radii(gaussians: Projected, size: tuple[int, int], options: Options) -> Tensor:
    """Return half the longer side [M] of the box in which alpha reaches alpha_min, `Statistics.radii`."""
    if options.alpha_min == 0:
        return torch.full_like(gaussians.depth, math.hypot(*size))
    rho = largest_rho(gaussians.opacity, options)
    reach = (rho[:, None] * gaussians.covariance.diagonal(dim1=1, dim2=2)).sqrt()  # [M, 2]
    return half_extents(gaussians.centre - reach, gaussians.centre + reach, size)
