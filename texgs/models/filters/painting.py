"""Drawings of dots and lines whose density is tone, and paintings in oil, watercolour and flat tones."""

from __future__ import annotations

import torch
from torch import Tensor

from texgs.models.filters.surface import (
    Surface,
    cell_hash,
    fractal_noise,
    neighbours,
    tangential,
    value_noise,
)

PAPER = (0.97, 0.96, 0.92)
INK = (0.07, 0.07, 0.10)
GRAPHITE = (0.20, 0.20, 0.23)
HATCHES = ((0.62, 0.55, 0.56), (-0.66, 0.52, 0.54), (0.10, 0.95, -0.30))  # directions across the lines
STEEP = 0.4  # sine between surface and hatch below which its lines would be bands


def stipple(surface: Surface) -> Tensor:
    """Draw dots [P, 3]: more and larger where it is dark, at random places one cell apart."""
    points = surface.points * 1.5
    darkness = 1 - surface.tone
    ink = torch.zeros_like(darkness)
    for vector, cells in neighbours(points, 0, jitter=0.75):
        distance = tangential(vector, surface.normals, 0.6).norm(dim=1)
        is_there = cell_hash(cells, 7) < 0.25 + 1.1 * darkness
        radius = 0.17 + 0.30 * darkness
        ink = torch.maximum(ink, is_there * surface.ramp((distance - radius) / 1.5))
    return _mix(PAPER, INK, ink)


def hatching(surface: Surface) -> Tensor:
    """Draw pencil lines [P, 3] in up to three directions: the darker, the more."""
    points = surface.points * 1.6
    wobble = value_noise(points * 0.35, 0)
    grain = fractal_noise(points * 2.5, 5, octaves=2)
    ink = torch.zeros_like(surface.tone)
    for layer, direction in enumerate(HATCHES):
        across = points.new_tensor(direction)
        across = across / across.norm()
        sine = (1 - (surface.normals @ across).square()).clamp_min(1e-4).sqrt()
        phase = points @ across + 0.7 * wobble
        gap = (phase - phase.floor() - 0.5).abs() / sine  # distance along the surface to the line's middle
        dark = ((0.88 - 0.24 * layer - surface.tone) / 0.3).clamp(0, 1)
        line = surface.ramp((gap - (0.10 + 0.20 * dark)) / 1.6) * (0.35 + 0.65 * dark) * (dark > 0)
        ink = torch.maximum(ink, line * ((sine - STEEP) / 0.15).clamp(0, 1))
    return _mix(PAPER, GRAPHITE, ink * (0.55 + 0.75 * grain).clamp(0, 1))


def woodcut(surface: Surface) -> Tensor:
    """Cut black lines [P, 3] that swell where it is dark, along one bent direction, and nothing between."""
    points = surface.points
    across = points.new_tensor((0.18, 0.97, 0.16))
    bend = fractal_noise(points * 0.25, 0, octaves=2)
    phase = points @ (across / across.norm()) + 2.2 * bend
    wave = (phase - phase.floor() - 0.5).abs() * 2  # [0, 1], 0 in the middle of a line
    width = (1.25 - 1.35 * surface.tone).clamp(0.04, 1.1)
    return _mix((0.95, 0.90, 0.79), (0.06, 0.05, 0.05), surface.ramp((wave - width) / 2))


def _mix(paper: tuple[float, ...], ink: tuple[float, ...], share: Tensor) -> Tensor:
    """Return ink on paper [P, 3]."""
    low, high = share.new_tensor(paper), share.new_tensor(ink)
    return low + share[:, None] * (high - low)


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
