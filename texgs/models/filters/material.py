"""Materials: stone and wood cut from a block, metal, mosaic, and any colour."""

from __future__ import annotations

import math
from collections.abc import Sequence

import torch
from torch import Tensor

from texgs.models.filters.surface import (
    Surface,
    cell_hash,
    fractal_noise,
    luminance,
    neighbours,
    tangential,
    value_noise,
)

GOLD = ((0.30, 0.16, 0.03), (0.93, 0.66, 0.20), (1.00, 0.92, 0.60))  # dark, middle, light
SILVER = ((0.22, 0.23, 0.26), (0.70, 0.72, 0.75), (0.97, 0.98, 1.00))
COPPER = ((0.25, 0.09, 0.05), (0.80, 0.42, 0.25), (1.00, 0.80, 0.65))


def marble(surface: Surface) -> Tensor:
    """Return white stone [P, 3] with dark veins: sines bent by turbulence (Perlin 1985), broad and fine."""
    points = surface.points * 0.22
    veins = torch.zeros_like(surface.tone)
    for k, (direction, frequency, sharpness, weight) in enumerate(
        (((0.6, 0.7, 0.4), 1.0, 9.0, 0.85), ((-0.7, 0.3, 0.65), 2.3, 14.0, 0.6))
    ):
        bent = points @ points.new_tensor(direction) * frequency + 2.4 * fractal_noise(points * 1.3, 11 * k)
        line = 1 - torch.sin(math.pi * bent).abs()
        veins = torch.maximum(veins, weight * line.pow(sharpness))
    cloud = fractal_noise(points * 2, 29)
    stone = torch.lerp(
        _color(surface, (0.80, 0.81, 0.83)), _color(surface, (0.98, 0.97, 0.95)), cloud[:, None]
    )
    return torch.lerp(stone, _color(surface, (0.16, 0.18, 0.22)), veins[:, None])


def wood(surface: Surface) -> Tensor:
    """Return year rings [P, 3] around an upright axis, with fibres along it."""
    points = surface.points
    x, y, z = points.unbind(dim=1)
    bent = 1.6 * fractal_noise(points * 0.12, 0, octaves=2)
    rings = torch.remainder(((x + 3).square() + (z - 2).square()).sqrt() * 0.55 + 2 * bent, 1.0)
    fibre = value_noise(torch.stack([x * 5, y * 0.35, z * 5], dim=1), 3)
    late = rings.pow(3)[:, None]
    plank = torch.lerp(_color(surface, (0.80, 0.58, 0.35)), _color(surface, (0.42, 0.24, 0.11)), late)
    return (plank * (0.82 + 0.32 * fibre)[:, None]).clamp(0, 1)


def metal(surface: Surface, tones: Sequence[tuple[float, float, float]]) -> Tensor:
    """Return hammered metal [P, 3]: a steep ramp of tones over the light and small dents."""
    dents = fractal_noise(surface.points * 0.7, 0, octaves=2)
    level = (1.15 * surface.shade + 0.55 * (dents - 0.5)).clamp(0, 1)[:, None]
    dark, middle, light = (_color(surface, tone) for tone in tones)
    low = torch.lerp(dark, middle, (level / 0.55).clamp(0, 1))
    return torch.lerp(low, light, ((level - 0.55) / 0.45).clamp(0, 1))


def mosaic(surface: Surface) -> Tensor:
    """Lay tiles [P, 3] with dark joints, each of one shade."""
    first = torch.full_like(surface.tone, torch.inf)
    second, shade = first.clone(), torch.zeros_like(first)
    for vector, cells in neighbours(surface.points * 0.9, 0, jitter=0.8):
        distance = tangential(vector, surface.normals, 0.7).norm(dim=1)
        is_first = distance < first
        second = torch.where(is_first, first, torch.minimum(second, distance))
        first = torch.where(is_first, distance, first)
        shade = torch.where(is_first, cell_hash(cells, 3), shade)
    tile = surface.color * (0.60 + 0.55 * shade)[:, None] + 0.10 * (shade[:, None] - 0.5)
    joint = surface.ramp((second - first - 0.14) / 0.9)[:, None]
    return torch.lerp(tile.clamp(0, 1), _color(surface, (0.13, 0.12, 0.12)), joint)


def tint(surface: Surface, color: tuple[float, float, float]) -> Tensor:
    """Return one colour [P, 3], as much lighter or darker as the scene was than its mean."""
    luma = luminance(surface.color)
    ratio = (luma / luma.mean().clamp_min(1e-3))[:, None]
    wanted = _color(surface, color)
    lighter = torch.lerp(wanted, torch.ones_like(wanted), (ratio - 1).clamp(0, 1) * 0.5)
    return torch.where(ratio < 1, wanted * ratio, lighter).clamp(0, 1)


def _color(surface: Surface, color: Sequence[float]) -> Tensor:
    """Return one colour for all points [P, 3]."""
    return surface.color.new_tensor(color).expand_as(surface.color)
