"""The colours that stylising starts from: close to the style already, they save most of the iterations."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from texgs.core import check
from texgs.core.camera import Camera
from texgs.edit.layout import laid_out
from texgs.edit.recipe import Start
from texgs.edit.style_picture import StylePicture
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.texels import bare_colors

LEAST = 1e-10  # added to the eigenvalues of covariances


def start_colors(
    kind: Start, model: Surfels, style: StylePicture, pixel: float, seed: int, changing: Tensor | None = None
) -> Tensor:
    """Return colours of all texels [T, 3] in [0, 1], without light.

    The style has the size at which it is laid onto the surface, where a pixel of it has a side in world
    units. Colours that are moved to those of the style are those of changing texels [T], by default of all.
    """
    p = model.parameters
    if kind in ("projected", "sphere"):
        return laid_out(p, style.image, pixel, sphere=kind == "sphere")
    if kind == "mean":
        return style.mean.expand_as(p["texels"]).contiguous()
    if kind == "random":
        pixels = style.pixels
        generator = torch.Generator().manual_seed(seed)
        chosen = torch.randint(len(pixels), (len(p["texels"]),), generator=generator)
        return pixels[chosen.to(pixels.device)]
    own = bare_colors(model).clamp(0, 1)
    matrix, shift = color_map(own if changing is None else own[changing], style.pixels)
    return (own @ matrix.T.to(own) + shift.to(own)).clamp(0, 1)


def pixel_side(model: Surfels, cameras: Sequence[Camera]) -> float:
    """Return the side of a pixel at the model's middle, mean over cameras, world units."""
    middle = model.parameters["means"].mean(0)
    sides = []
    for camera in cameras:
        viewmat, K = (x.to(middle) for x in (camera.viewmat, camera.K))
        sides.append((viewmat[2, :3] @ middle + viewmat[2, 3]).abs() / K[1, 1])
    return float(torch.stack(sides).mean())


def color_map(colors: Tensor, style: Tensor) -> tuple[Tensor, Tensor]:
    """Return the affine map x -> A x + b that gives colours [N, 3] mean and covariance of a style's [M, 3].

    With S the covariances and m the means, A = S_style^(1/2) S_colors^(-1/2) and b = m_style - A m_colors
    (Zhang et al. 2022, supplement; symmetric square roots), float64. Not differentiable.
    """
    from kornia.enhance import zca_mean

    for name, x in (("colors", colors), ("style", style)):
        check.shape(name, x, "N 3")
    (whiten, mean, _), (whiten_style, mean_style, _) = (
        zca_mean(x.detach().double(), unbiased=False, eps=LEAST) for x in (colors, style)
    )
    matrix = torch.linalg.solve(whiten_style, whiten)
    return matrix, mean_style[0] - matrix @ mean[0]
