"""The scene of `texgs demo`: a trefoil knot of a few thousand surfels, each with a small texture."""

from __future__ import annotations

from dataclasses import dataclass
from math import tau

import torch
from torch import Tensor
from torch.nn.functional import normalize

from texgs.core.rotation import matrices_to_quats

TUBE = 0.2  # radius of the tube; the knot itself spans about +-1
TEXELS = 12  # texels along each side of a surfel: the pattern is much finer than the surfels
PALETTE = ((0.05, 0.36, 0.47), (0.93, 0.71, 0.35), (0.82, 0.30, 0.24), (0.39, 0.20, 0.45))  # around the knot


@dataclass(frozen=True)
class DemoScene:
    """Surfels in world space with a texture each, before shading."""

    means: Tensor  # [N, 3]
    quats: Tensor  # [N, 4] wxyz
    scales: Tensor  # [N, 2]
    opacities: Tensor  # [N]
    texels: Tensor  # [T, 3]
    sizes: Tensor  # [N, 2] int32
    offsets: Tensor  # [N] int64


def knot_scene(n_along: int = 320, n_around: int = 24) -> DemoScene:
    """Lay surfels on a tube around a trefoil knot and sample a woven pattern into their textures.

    Args:
        n_along: surfels along the knot.
        n_around: surfels around the tube.
    """
    t = torch.arange(n_along, dtype=torch.float64) / n_along * tau
    phi = torch.arange(n_around, dtype=torch.float64) / n_around * tau
    t, phi = (grid.reshape(-1) for grid in torch.meshgrid(t, phi, indexing="ij"))  # [N]
    phi = phi + t / tau * n_along % 2 * tau / n_around / 2  # every second ring turned by half a surfel
    means, frames, speed = tube(t, phi)
    scales = 0.62 * torch.stack([speed * tau / n_along, torch.full_like(t, TUBE * tau / n_around)], dim=-1)
    n = len(t)
    return DemoScene(
        means=means.float(),
        quats=matrices_to_quats(frames).float(),
        scales=scales.float(),
        opacities=torch.full((n,), 0.9),
        texels=textures(t, phi, scales, speed).float(),
        sizes=torch.full((n, 2), TEXELS, dtype=torch.int32),
        offsets=torch.arange(n) * TEXELS**2,
    )


def curve(t: Tensor) -> Tensor:
    """Points [N, 3] of a trefoil knot; it lies in the xy plane and closes after a full turn of t."""
    x = torch.sin(t) + 2 * torch.sin(2 * t)
    y = torch.cos(t) - 2 * torch.cos(2 * t)
    return torch.stack([x, y, -1.2 * torch.sin(3 * t)], dim=-1) / 3


def tube(t: Tensor, phi: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Surface of the tube.

    Returns:
        Points [N, 3], frames [N, 3, 3] with columns along, around and outward, and the length of surface per
        unit of t [N].
    """
    step = 1e-4
    ahead, behind, here = curve(t + step), curve(t - step), curve(t)
    along = normalize(ahead - behind, dim=-1)
    side = normalize(torch.linalg.cross(along, along.new_tensor([[0.0, 0.0, 1.0]]).expand_as(along)), dim=-1)
    over = torch.linalg.cross(side, along)
    outward = phi.cos()[:, None] * side + phi.sin()[:, None] * over
    bend = (ahead - 2 * here + behind) / step**2  # the tube is longer on the outside of a bend
    velocity = (ahead - behind).norm(dim=-1) / (2 * step)
    speed = velocity - TUBE * (bend * outward).sum(-1) / velocity
    around = torch.linalg.cross(outward, along)
    frames = torch.stack([along, around, outward], dim=-1)
    return here + TUBE * outward, frames, speed


def textures(t: Tensor, phi: Tensor, scales: Tensor, speed: Tensor) -> Tensor:
    """Sample the pattern at the texel centres of every surfel: [N * TEXELS^2, 3]."""
    edge = 6 * ((torch.arange(TEXELS, dtype=t.dtype) + 0.5) / TEXELS - 0.5)  # texel centres, in sigma
    along = edge[None, None, :] * scales[:, 0, None, None]  # [N, 1, U]
    around = edge[None, :, None] * scales[:, 1, None, None]  # [N, V, 1]
    shape = (len(t), TEXELS, TEXELS)
    t_texel = (t[:, None, None] + along / speed[:, None, None]).expand(shape)
    phi_texel = (phi[:, None, None] + around / TUBE).expand(shape)
    return pattern(t_texel, phi_texel).reshape(-1, 3)


def pattern(t: Tensor, phi: Tensor) -> Tensor:
    """Colour [..., 3] at a place on the tube: a palette around the knot, woven into diamonds."""
    colors = t.new_tensor([*PALETTE, PALETTE[0]])
    place = t / tau % 1 * len(PALETTE)
    index = place.long().clamp(max=len(PALETTE) - 1)
    blend = (place - index)[..., None]
    blend = blend * blend * (3 - 2 * blend)
    color = colors[index] * (1 - blend) + colors[index + 1] * blend
    left, right = torch.sin(18 * t + 2 * phi), torch.sin(18 * t - 2 * phi)
    weave = torch.sigmoid(14 * left * right)[..., None]  # 0 and 1 in alternating diamonds
    lines = torch.exp(-((torch.minimum(left.abs(), right.abs()) / 0.09) ** 2))[..., None]
    light = color + 0.5 * (1 - color)
    woven = color * weave + light * (1 - weave)
    return woven * (1 - 0.75 * lines) + 0.75 * lines * t.new_tensor([0.98, 0.95, 0.88])
