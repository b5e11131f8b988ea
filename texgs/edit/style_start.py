"""The colours that stylising starts from: close to the style already, they save most of the iterations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import torch
from torch import Tensor
from torch.nn import functional as F

from texgs.core import check
from texgs.core.camera import Camera
from texgs.core.geometry import quats_to_matrices
from texgs.edit.recipe import Start
from texgs.edit.style_picture import StylePicture
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.texels import EXTENT, bare_colors, owners

LEAST = 1e-10  # added to the eigenvalues of covariances
SHARPNESS = 8  # power of the normal's components that weighs the projections
CHUNK = 1 << 18  # texels at a time


def start_colors(
    kind: Start, model: Surfels, style: StylePicture, pixel: float, seed: int, changing: Tensor | None = None
) -> Tensor:
    """Return colours of all texels [T, 3] in [0, 1], without light.

    The style has the size at which it is laid onto the surface, where a pixel of it has a side in world
    units. Colours that are moved to those of the style are those of changing texels [T], by default of all.
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


@torch.no_grad()
def project(parameters: Mapping[str, Tensor], picture: Tensor, pixel: float) -> Tensor:
    """Return the colour of every texel [T, 3] from a picture [3, h, w] that is mirrored beyond its edges.

    Blended around the picture's mean by weights divided by the root of the sum of their squares, so that
    contrast is as high where projections meet as elsewhere (Heitz and Neyret 2018). A pixel has a side in
    world units. Texels that no surfel owns are black.
    """
    check.shape("picture", picture, "3 h w")
    p = parameters
    axes = quats_to_matrices(p["quats"])  # [N, 3, 3], columns are both tangents and the normal
    tangents = axes[:, :, :2] * p["scales"].exp()[:, None]  # of one standard deviation
    weights = axes[:, :, 2].abs() ** SHARPNESS
    weights = weights / weights.square().sum(1, keepdim=True).sqrt()
    mean = picture.mean(dim=(1, 2))
    places, surfels = owners(p)
    colors = torch.zeros_like(p["texels"])
    for place, surfel in zip(places.split(CHUNK), surfels.split(CHUNK), strict=True):
        points = centres(p, place, surfel, tangents)
        sampled = sample(picture, points / pixel) - mean  # [3, n, 3]
        blended = torch.einsum("anc,na->nc", sampled, weights[surfel]) + mean
        colors[place] = blended.clamp(0, 1)
    return colors


def centres(parameters: Mapping[str, Tensor], place: Tensor, surfel: Tensor, tangents: Tensor) -> Tensor:
    """Return centres [n, 3] in the world of texels at `place` [n] in the list, which are of `surfel` [n]."""
    p = parameters
    sizes, within = p["sizes"].long()[surfel], place - p["offsets"][surfel]
    cells = torch.stack([within % sizes[:, 0], within // sizes[:, 0]], dim=1)
    uv = EXTENT * ((cells + 0.5) / sizes - 0.5)  # [n, 2] standard deviations
    return p["means"][surfel] + (tangents[surfel] @ uv[:, :, None])[:, :, 0]


def sample(picture: Tensor, points: Tensor) -> Tensor:
    """Return colours [3, n, 3] of points [n, 3], in pixels around the picture's middle, along each axis.

    Seen along x the picture shows z and y, along y it shows x and z, along z it shows x and y; up is +y.
    """
    x, y, z = points.unbind(1)
    size = points.new_tensor(picture.shape[:0:-1])  # width and height
    planes = torch.stack([torch.stack(pair, 1) for pair in ((z, -y), (x, z), (x, -y))])  # [3, n, 2]
    grid, pictures = (planes * 2 / size)[:, None], picture.expand(3, -1, -1, -1)
    sampled = F.grid_sample(pictures, grid, padding_mode="reflection", align_corners=False)
    return sampled[:, :, 0].transpose(1, 2)
