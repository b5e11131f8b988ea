"""Drawings of dots and lines whose density is tone, paintings, and materials cut from a block."""

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

PAPER = (0.97, 0.96, 0.92)
INK = (0.07, 0.07, 0.10)
GRAPHITE = (0.20, 0.20, 0.23)
HATCHES = ((0.62, 0.55, 0.56), (-0.66, 0.52, 0.54), (0.10, 0.95, -0.30))  # directions across the lines
STEEP_SINE = 0.4  # least sine between surface and hatch; below it, lines widen into bands
GOLD = ((0.30, 0.16, 0.03), (0.93, 0.66, 0.20), (1.00, 0.92, 0.60))  # dark, middle, light
SILVER = ((0.22, 0.23, 0.26), (0.70, 0.72, 0.75), (0.97, 0.98, 1.00))
COPPER = ((0.25, 0.09, 0.05), (0.80, 0.42, 0.25), (1.00, 0.80, 0.65))


def stipple(surface: Surface) -> Tensor:
    """Draw dots [P, 3]: more and larger where it is dark, at random places one cell apart."""
    points = surface.points * 1.5
    darkness = 1 - surface.tone
    ink = torch.zeros_like(darkness)
    for vector, keys in neighbours(points, 0, jitter=0.75):
        distance = tangential(vector, surface.normals, 0.6).norm(dim=1)
        is_there = cell_hash(keys, 7) < 0.25 + 1.1 * darkness
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
        ink = torch.maximum(ink, line * ((sine - STEEP_SINE) / 0.15).clamp(0, 1))
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
    for vector, keys in neighbours(points, 0):
        flat = tangential(vector, surface.normals, 0.5)
        turn = torch.stack([cell_hash(keys, k) - 0.5 for k in (31, 37, 41)], dim=1)
        along = tangential(turn, surface.normals, 0.0)
        along = along / along.norm(dim=1, keepdim=True).clamp_min(1e-6)
        u = (flat * along).sum(dim=1)
        v = (flat.square().sum(dim=1) - u.square()).clamp_min(0).sqrt()
        side = (torch.linalg.cross(surface.normals, along) * flat).sum(dim=1)
        ragged = 0.12 * torch.sin(23 * side + 40 * turn[:, 0])
        is_inside = (u.abs() < 0.85 + ragged) & (v < 0.36)
        order = cell_hash(keys, 43)
        is_top = is_inside & (order > top)
        top = torch.where(is_top, order, top)
        value = torch.where(is_top, 2 * cell_hash(keys, 47) - 1, value)
        warm = torch.where(is_top, 2 * cell_hash(keys, 53) - 1, warm)
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
    rim = torch.exp(-((torch.remainder(level, 1.0) - 0.08) / 0.07).square())  # where a wash dried last
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
    """Saturate colours [P, 3]."""
    from kornia.enhance import adjust_saturation_with_gray_subtraction

    saturated: Tensor = adjust_saturation_with_gray_subtraction(colors.T[..., None], factor)[..., 0].T
    return saturated


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


def glass(surface: Surface) -> Tensor:
    """Return blown glass [P, 3] of the surface's colours: clear with deep swirls, and a few bubbles."""
    swirl = fractal_noise(surface.points * 0.2, 0, octaves=2)
    fold = 1 - torch.sin(2 * math.pi * (surface.points[:, 1] * 0.08 + 1.5 * swirl)).abs()
    deep = _saturated(surface.color, 1.6).clamp(0, 1)
    clear = torch.lerp(deep, _color(surface, (0.86, 0.96, 0.94)), 0.55)
    blown = torch.lerp(clear, 0.85 * deep, (0.8 * fold.square() + 0.3 * (1 - surface.shade))[:, None])
    bubble = torch.zeros_like(surface.tone)
    for vector, keys in neighbours(surface.points * 0.8, 5):
        rim = (vector.norm(dim=1) - 0.08 - 0.12 * cell_hash(keys, 7)) / 0.8
        bubble = torch.maximum(bubble, (cell_hash(keys, 9) < 0.25) * surface.ramp(rim))
    return torch.lerp(blown, torch.ones_like(blown), 0.6 * bubble[:, None]).clamp(0, 1)


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
    for vector, keys in neighbours(surface.points * 0.9, 0, jitter=0.8):
        distance = tangential(vector, surface.normals, 0.7).norm(dim=1)
        is_first = distance < first
        second = torch.where(is_first, first, torch.minimum(second, distance))
        first = torch.where(is_first, distance, first)
        shade = torch.where(is_first, cell_hash(keys, 3), shade)
    tile = surface.color * (0.60 + 0.55 * shade)[:, None] + 0.10 * (shade[:, None] - 0.5)
    joint = surface.ramp((second - first - 0.14) / 0.9)[:, None]
    return torch.lerp(tile.clamp(0, 1), _color(surface, (0.13, 0.12, 0.12)), joint)


def tint(surface: Surface, color: tuple[float, float, float]) -> Tensor:
    """Return one colour [P, 3] with the relative brightness of the scene."""
    luma = luminance(surface.color)
    ratio = (luma / luma.mean().clamp_min(1e-3))[:, None]
    wanted = _color(surface, color)
    lighter = torch.lerp(wanted, torch.ones_like(wanted), (ratio - 1).clamp(0, 1) * 0.5)
    return torch.where(ratio < 1, wanted * ratio, lighter).clamp(0, 1)


def _color(surface: Surface, color: Sequence[float]) -> Tensor:
    """Return one colour for all points [P, 3]."""
    return surface.color.new_tensor(color).expand_as(surface.color)
