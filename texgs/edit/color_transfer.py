"""Colours of one set of pixels made to be distributed as those of another: mean and covariance (ARF)."""

from __future__ import annotations

import torch
from torch import Tensor

from texgs.core import check

LEAST = 1e-10  # added to the eigenvalues of covariances


def color_map(colors: Tensor, style: Tensor) -> tuple[Tensor, Tensor]:
    """The affine map x -> A x + b that gives colours the mean and covariance of a style's.

    With S the covariances and m the means, A = S_style^(1/2) S_colors^(-1/2) and b = m_style - A m_colors
    (Zhang et al. 2022, supplement; symmetric square roots). Not differentiable.

    Args:
        colors: [N, 3].
        style: [M, 3].

    Returns:
        A [3, 3] and b [3], float64.
    """
    from kornia.enhance import zca_mean

    for name, x in (("colors", colors), ("style", style)):
        check.shape(name, x, "N 3")
    (whiten, mean, _), (whiten_style, mean_style, _) = (
        zca_mean(x.detach().double(), unbiased=False, eps=LEAST) for x in (colors, style)
    )
    matrix = torch.linalg.solve(whiten_style, whiten)
    return matrix, mean_style[0] - matrix @ mean[0]
