"""Paintings: dabs of oil, washes of watercolour, flat tones of a cartoon."""

from __future__ import annotations

import torch
from torch import Tensor

from texgs.models.filters.noise import cell_hash, fractal_noise, neighbours, tangential, value_noise
from texgs.models.filters.surface import Surface


def oil(surface: Surface) -> Tensor:
    """Paint overlapping dabs [P, 3] of a flat brush, each with a direction, a mix of pigments, bristles."""
    points = surface.points * 0.8
    top = torch.full_like(surface.tone, -1.0)
    value, warm, relief = (torch.zeros_like(surface.tone) for _ in range(3))
    for vector, cells in neighbours(points, 0):
        flat = tangential(vector, surface.normals, 0.5)
        turn = torch.stack([cell_hash(cells, k) - 0.5 for k in (31, 37, 41)], dim=1)
        along = tangential(turn, surface.normals, 0.0)
        along = along / along.norm(dim=1, keepdim=True).clamp_min(1e-6)
        u = (flat * along).sum(dim=1)
        v = (flat.square().sum(dim=1) - u.square()).clamp_min(0).sqrt()
        side = (torch.linalg.cross(surface.normals, along) * flat).sum(dim=1)
        ragged = 0.12 * torch.sin(23 * side + 40 * turn[:, 0])
        is_inside = (u.abs() < 0.85 + ragged) & (v < 0.36)
        order = cell_hash(cells, 43)
        is_top = is_inside & (order > top)
        top = torch.where(is_top, order, top)
        value = torch.where(is_top, 2 * cell_hash(cells, 47) - 1, value)
        warm = torch.where(is_top, 2 * cell_hash(cells, 53) - 1, warm)
        bristles = 0.45 * torch.sin(38 * side + 9 * turn[:, 1]) + 1.6 * side  # light from one side of a dab
        relief = torch.where(is_top, bristles, relief)
    steps = (surface.shade * 4).floor() / 4 + 0.2
    base = surface.color * (0.55 + 0.55 * steps[:, None])
    hue = base.new_tensor((0.20, -0.03, -0.18)) * warm[:, None]
    return (base * (1 + 0.30 * value + 0.16 * relief)[:, None] + hue).clamp(0, 1)


def watercolour(surface: Surface) -> Tensor:
    """Paint washes [P, 3] on paper: pools with dark rims, blooms, the paper's grain, blue shadows."""
    points = surface.points
    pool = fractal_noise(points * 0.30, 0, octaves=3)
    level = 5.0 * pool
    rim = torch.exp(-((torch.remainder(level, 1.0) - 0.08) / 0.07).square())  # where a wash has dried last
    grain = value_noise(points * 4.5, 9)
    density = 0.30 * (level.floor() - 1).clamp_min(0) + 0.45 * rim + 0.25 * (grain - 0.5)
    density = (density + 0.35 * (1 - surface.shade)).clamp(0.03, 1.3)
    bloom = (value_noise(points * 0.18, 21) - 0.5)[:, None]  # pigments part: warm here, cool there
    pigment = _saturated(surface.color, 1.35) + bloom * surface.color.new_tensor((0.35, -0.25, 0.45))
    shadow = pigment.new_tensor((0.36, 0.42, 0.72))
    pigment = torch.lerp(pigment, pigment * shadow * 1.4, (1 - surface.shade)[:, None] * 0.75)
    paper = pigment.new_tensor((0.985, 0.975, 0.95))
    # Light goes through the pigment twice: it subtracts, more where there is more.
    return (paper * (pigment.clamp(0.03, 1) ** density[:, None])).clamp(0, 1)


def cartoon(surface: Surface) -> Tensor:
    """Paint three flat tones [P, 3] of a strong colour, and a line of ink where shadow begins."""
    tone = surface.shade
    strong = _saturated(surface.color, 1.5)
    levels = [strong * strong.new_tensor((0.42, 0.38, 0.55)), strong * 0.82]
    levels.append(torch.lerp(strong, torch.ones_like(strong), 0.35))
    width = 0.05
    is_lit, is_bright = (((tone - border) / 0.04 + 0.5).clamp(0, 1)[:, None] for border in (0.42, 0.80))
    flat = torch.lerp(torch.lerp(levels[0], levels[1], is_lit), levels[2], is_bright)
    ink = surface.ramp(((tone - 0.42).abs() - width / 2) * 4)
    return torch.lerp(flat, flat.new_tensor((0.05, 0.04, 0.08)).expand_as(flat), ink[:, None])


def _saturated(colors: Tensor, factor: float) -> Tensor:
    """Return colours [P, 3] farther from the grey of their luminance."""
    from kornia.enhance import adjust_saturation_with_gray_subtraction

    saturated: Tensor = adjust_saturation_with_gray_subtraction(colors.T[..., None], factor)[..., 0].T
    return saturated
