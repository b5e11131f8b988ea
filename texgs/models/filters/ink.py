"""Drawings in ink and pencil on paper: dots and lines whose density is tone."""

from __future__ import annotations

import torch
from torch import Tensor

from texgs.models.filters.noise import cell_hash, fractal_noise, neighbours, tangential, value_noise
from texgs.models.filters.surface import Surface

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
