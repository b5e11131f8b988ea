"""The definition of surfels (Huang et al. 2024): projection of their planes, and intersection with rays."""

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from texgs.core.geometry import quats_to_matrices
from texgs.raster.reference.fragments import Fragments, alpha_of, depth_order, half_extents, largest_rho
from texgs.raster.types import Options


@dataclass(frozen=True)
class Projected:
    """The M surfels that a view keeps, front to back."""

    index: Tensor  # [M] position among the N inputs
    opacity: Tensor  # [M]
    depth: Tensor  # [M] camera z of the mean
    tangent_depth: Tensor  # [M, 2] camera z of one standard deviation along u and along v
    homography: Tensor  # [M, 3, 3] rows Tu, Tv, Tw: homogeneous pixel of (u, v, 1)
    centre: Tensor  # [M, 2] pixel at which the low-pass filter sits
    normal: Tensor  # [M, 3] unit, world axes, towards the camera


def project(
    means: Tensor,
    quats: Tensor,
    scales: Tensor,
    opacities: Tensor,
    viewmat: Tensor,
    K: Tensor,
    shift: Tensor | None,
    size: tuple[int, int],  # as 3D Gaussians need it
    options: Options,
) -> Projected:
    """Keep the surfels beyond the near plane that can be seen at all, sort them by depth, project them."""
    R_cw, t_cw = viewmat[:3, :3], viewmat[:3, 3]
    index = depth_order(means @ R_cw[2] + t_cw[2], opacities, options)
    axes = quats_to_matrices(quats[index])  # [M, 3, 3] columns: first tangent, second tangent, normal
    tangents = R_cw @ axes[:, :, :2] * scales[index][:, None, :]  # [M, 3, 2] camera axes
    mean = means[index] @ R_cw.T + t_cw  # [M, 3] camera axes
    plane = torch.cat(
        [tangents, mean[:, :, None]], 2
    )  # [M, 3, 3]: point of the surfel's plane = plane @ (u, v, 1)
    homography = K @ plane
    if shift is not None:
        homography = homography + torch.nn.functional.pad(shift[index], (0, 1))[:, :, None] * plane[:, 2:3, :]

    to_camera = -R_cw.T @ t_cw - means[index]  # [M, 3]
    facing = (axes[:, :, 2] * to_camera).sum(1, keepdim=True) >= 0
    return Projected(
        index=index,
        opacity=opacities[index],
        depth=mean[:, 2],
        tangent_depth=tangents[:, 2, :],
        homography=homography,
        centre=box(homography, options.filter_sigma**2)[0],
        normal=torch.where(facing, axes[:, :, 2], -axes[:, :, 2]),
    )


def box(homography: Tensor, rho: Tensor | float) -> tuple[Tensor, Tensor, Tensor]:
    """Return the bounding box on screen of the disc u^2 + v^2 <= rho, and whether it is before the camera.

    The box is its middle [M, 2] and squared half extents [M, 2]. Where the disc reaches behind the camera,
    the middle is that of the projected mean and the extents have no meaning.
    """
    level = torch.as_tensor(rho, dtype=homography.dtype, device=homography.device).expand(len(homography))
    signature = torch.stack([level, level, -torch.ones_like(level)], 1)  # [M, 3]
    D = (homography * signature[:, None, :]) @ homography.mT  # [M, 3, 3] the dual conic of the disc's image
    D_ww = D[:, 2, 2]
    before = D_ww < 0
    safe = torch.where(before, D_ww, -torch.ones_like(D_ww))[:, None]
    middle = D[:, :2, 2] / safe
    squared = middle**2 - torch.stack([D[:, 0, 0], D[:, 1, 1]], 1) / safe
    mean = homography[:, :2, 2] / homography[:, 2:, 2]
    return torch.where(before[:, None], middle, mean), squared, before


def intersect(surfels: Projected, pixels: Tensor, options: Options) -> Fragments:
    """Intersect the ray of each pixel [P, 2] with the plane of each surfel.

    The depth of a fragment is that of the mean where the low-pass filter wins.
    """
    Tu, Tv, Tw = surfels.homography.unbind(1)  # [M, 3] each
    inverse = torch.stack(
        [torch.linalg.cross(*pair) for pair in ((Tv, Tw), (Tw, Tu), (Tu, Tv))], 2
    )  # [M, 3, 3]
    homogeneous = torch.nn.functional.pad(pixels, (0, 1), value=1.0)  # [P, 3] (x, y, 1)
    U, V, W = torch.einsum("mij,pj->ipm", inverse, homogeneous)  # [P, M] each
    parallel = W.abs() < torch.finfo(W.dtype).tiny ** 0.25  # so that squares and gradients stay finite
    W = torch.where(parallel, torch.ones_like(W), W)
    u, v = U / W, V / W
    z = surfels.depth + u * surfels.tangent_depth[:, 0] + v * surfels.tangent_depth[:, 1]

    hit = (z > options.near) & ~parallel
    rho_surfel = torch.where(hit, u**2 + v**2, math.inf)
    rho_filter = options.low_pass * ((pixels[:, None, :] - surfels.centre) ** 2).sum(2)
    filtered = rho_filter < rho_surfel
    rho = torch.where(filtered, rho_filter, rho_surfel)
    depth = torch.where(filtered | ~hit, surfels.depth, z)
    return Fragments(u, v, depth, alpha_of(surfels.opacity, rho, options))


def visible_radii(surfels: Projected, size: tuple[int, int], options: Options) -> Tensor:
    """Return half the longer side [M] of the box in which alpha reaches alpha_min, `Statistics.radii`."""
    if options.alpha_min == 0:
        return torch.full_like(surfels.depth, math.hypot(*size))
    rho = largest_rho(surfels.opacity, options)
    middle, squared, before = box(surfels.homography, rho)
    reach = torch.where(before[:, None], squared.clamp(min=0).sqrt(), math.inf)  # [M, 2]
    disc = (rho / options.low_pass).sqrt()[:, None]
    low = torch.minimum(middle - reach, surfels.centre - disc)
    high = torch.maximum(middle + reach, surfels.centre + disc)
    return half_extents(low, high, size)
