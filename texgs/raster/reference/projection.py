"""Surfels on the screen: which are seen, in which order, and how their planes map to pixels."""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from texgs.core.rotation import quats_to_matrices
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
    options: Options,
) -> Projected:
    """Keep the surfels beyond the near plane that can be seen at all, sort them by depth, project them."""
    R_cw, t_cw = viewmat[:3, :3], viewmat[:3, 3]
    depth = means @ R_cw[2] + t_cw[2]  # [N]
    kept = (depth > options.near) & (opacities >= options.alpha_min)
    order = torch.argsort(depth, stable=True)  # equal depths keep the order of the inputs
    index = order[kept[order]]

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
    """Bounding box on screen of the disc u^2 + v^2 <= rho.

    Returns:
        Middle [M, 2], that of the projected mean where the disc reaches behind the camera; squared half
        extents [M, 2], meaningless there; whether the disc lies before the camera [M].
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


def visible_radii(surfels: Projected, width: int, height: int, options: Options) -> Tensor:
    """Half of the longer side [M] of the box in which alpha can reach alpha_min, see `Statistics.radii`."""
    diagonal = math.hypot(width, height)
    if options.alpha_min == 0:
        return torch.full_like(surfels.depth, diagonal)
    rho = 2 * torch.log(surfels.opacity / options.alpha_min).clamp(min=0)
    middle, squared, before = box(surfels.homography, rho)
    reach = torch.where(before[:, None], squared.clamp(min=0).sqrt(), math.inf)  # [M, 2]
    disc = (rho / options.low_pass).sqrt()[:, None]
    low = torch.minimum(middle - reach, surfels.centre - disc)
    high = torch.maximum(middle + reach, surfels.centre + disc)
    size = torch.tensor([width, height], device=low.device)
    on_screen = ((high > 0) & (low < size)).all(1)
    return torch.where(on_screen, ((high - low) / 2).amax(1).clamp(max=diagonal), 0.0)
