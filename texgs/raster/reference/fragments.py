"""Common parts of the definitions of surfels and 3D Gaussians."""

import math
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from texgs.raster.types import Options

ALPHA_MAX = 0.99  # no fragment takes all light, so that those behind it still receive a gradient (3DGS, 2DGS)


@dataclass(frozen=True)
class Fragments:
    """Each of the M primitives at each of the P pixels."""

    u: Tensor  # [P, M] place in standard deviations along the first axis of the primitive
    v: Tensor  # [P, M] ... the second
    depth: Tensor  # [P, M] camera z
    alpha: Tensor  # [P, M] 0 where skipped


def depth_order(depth: Tensor, opacities: Tensor, options: Options) -> Tensor:
    """Return the indices [M] of the kept among N primitives, front to back; the sort is stable."""
    kept = (depth > options.near) & (opacities >= options.alpha_min)
    order = torch.argsort(depth, stable=True)
    return order[kept[order]]


def alpha_of(opacity: Tensor, rho: Tensor, options: Options) -> Tensor:
    """Return the alpha [P, M] at squared distances rho [P, M] in standard deviations; 0 below alpha_min."""
    alpha = (opacity * torch.exp(-rho / 2)).clamp(max=ALPHA_MAX)
    return torch.where(alpha >= options.alpha_min, alpha, 0.0)


def within(fragments: Fragments, depth_range: Tensor | None) -> Fragments:
    """Set alpha to 0 for fragments outside of the depth ranges [2, H, W], if any."""
    if depth_range is None:
        return fragments
    near, far = depth_range.flatten(1)[..., None]  # [P, 1] each
    counts = (near <= fragments.depth) & (fragments.depth < far)
    return replace(fragments, alpha=torch.where(counts, fragments.alpha, 0.0))


def largest_rho(opacity: Tensor, options: Options) -> Tensor:
    """Return the rho [M] at which alpha falls to alpha_min."""
    return 2 * torch.log(opacity / options.alpha_min).clamp(min=0)


def half_extents(low: Tensor, high: Tensor, size: tuple[int, int]) -> Tensor:
    """Return half the longer side [M] of boxes with corners [M, 2], at most the diagonal; 0 off screen."""
    on_screen = ((high > 0) & (low < torch.tensor(size, device=low.device))).all(1)
    return torch.where(on_screen, ((high - low) / 2).amax(1).clamp(max=math.hypot(*size)), 0.0)
