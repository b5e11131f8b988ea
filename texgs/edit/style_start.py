"""The colours that stylising starts from: close to the style already, they save most of the iterations."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.edit.color_transfer import color_map
from texgs.edit.recipe import Start
from texgs.edit.style_picture import StylePicture
from texgs.edit.triplanar import project
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.texels import bare_colors


def start_colors(
    kind: Start, model: Surfels, style: StylePicture, pixel: float, seed: int, changing: Tensor | None = None
) -> Tensor:
    """Colours of all texels [T, 3] in [0, 1], without light.

    Args:
        kind: see `Recipe`.
        model: textured.
        style: at the size at which it is laid onto the surface.
        pixel: side of one of its pixels there, world units.
        seed: of random pixels.
        changing: texels [T] bool whose colours are moved to those of the style; all by default.
    """
    p = model.parameters
    if kind == "projected":
        return project(p, style.image, pixel)
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
    """Side of a pixel at the model's middle, mean over cameras, world units."""
    middle = model.parameters["means"].mean(0)
    sides = []
    for camera in cameras:
        viewmat, K = (x.to(middle) for x in (camera.viewmat, camera.K))
        sides.append((viewmat[2, :3] @ middle + viewmat[2, 3]).abs() / K[1, 1])
    return float(torch.stack(sides).mean())
