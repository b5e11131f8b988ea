"""Colours of one set of pixels made to be distributed as those of another: mean and covariance (ARF)."""

from __future__ import annotations

import torch
from torch import Tensor

from texgs.core import check

SMALLEST, LARGEST = 1e-8, 1e8  # eigenvalues that count


def color_map(colors: Tensor, style: Tensor) -> tuple[Tensor, Tensor]:
    """The affine map x -> A x + b that gives colours the mean and covariance of a style's.

    With S the covariances and m the means, A = S_style^(1/2) S_colors^(-1/2) and b = m_style - A m_colors
    (Zhang et al. 2022, supplement; symmetric square roots). Not differentiable.

    Args:
        colors: [N, 3].
        style: [M, 3].

    Returns:
        A [3, 3] and b [3], float64.

    Raises:
        ShapeError: if a shape does not fit.
    """
    for name, x in (("colors", colors), ("style", style)):
        check.shape(name, x, "N 3")
    (mean, covariance), (mean_style, covariance_style) = (moments(x) for x in (colors, style))
    matrix = power(covariance_style, 0.5) @ power(covariance, -0.5)
    return matrix, mean_style - matrix @ mean


def moments(colors: Tensor) -> tuple[Tensor, Tensor]:
    """Mean [3] and covariance [3, 3] of colours [N, 3], float64."""
    colors = colors.detach().double()
    mean = colors.mean(0)
    return mean, (colors - mean).T @ (colors - mean) / len(colors)


def power(covariance: Tensor, exponent: float) -> Tensor:
    """A symmetric matrix [3, 3] to a power, its eigenvalues kept away from 0."""
    values, vectors = torch.linalg.eigh(covariance)
    return (vectors * values.clamp(SMALLEST, LARGEST) ** exponent) @ vectors.T
