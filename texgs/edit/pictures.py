"""Style pictures made by code, so that nobody else has a right in them: for demonstrations and tests."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image, ImageDraw

from texgs.core.errors import ArgumentError
from texgs.edit.noise import fractal, grid, palette, smoothstep, voronoi

if TYPE_CHECKING:
    from torch import Tensor

OVERSAMPLED = 2  # strokes are drawn at twice the size


def picture(name: str, size: int = 512) -> Tensor:
    """One of the pictures, square, the same on every machine but for rounding.

    Args:
        name: of PICTURES.
        size: pixels of each side.

    Returns:
        [3, size, size] in [0, 1].

    Raises:
        ArgumentError: if there is none of that name.
    """
    import torch  # not at the top: a plan of edits asks for the names only

    if name not in PICTURES:
        raise ArgumentError(f"picture: expected one of {', '.join(PICTURES)}, got {name!r}")
    pixels = PICTURES[name](size).clip(0, 1).astype(np.float32)
    return torch.from_numpy(pixels).permute(2, 0, 1).contiguous()


def strokes(size: int) -> np.ndarray:
    """Curved brush strokes of oil paint along a swirling sky: deep blues, yellow and cream around whirls."""
    rng = np.random.default_rng(11)
    full = OVERSAMPLED * size
    centres = np.array([[0.28, 0.33], [0.74, 0.24], [0.56, 0.72]])
    canvas = Image.new("RGB", (full, full), (24, 40, 92))
    draw = ImageDraw.Draw(canvas)
    tone = fractal(full, 3, seed=5)
    night = ["#0d1b4c", "#1b3f8b", "#2f6fb5", "#5fa3c9", "#a9cfd0"]
    fire = ["#d98e1f", "#f2b632", "#f7d76b", "#fbf0c4"]
    for width, count in ((0.022, 1600), (0.014, 2200), (0.009, 2600)):
        points = rng.random((count, 2))
        glow = np.exp(-((points[:, None] - centres) ** 2).sum(2) / 0.012).max(1)
        columns, rows = (points * full).astype(int).T
        shades = tone[rows, columns] + 0.35 * rng.standard_normal(count)
        is_fire = glow > 0.25 + 0.5 * rng.random(count)
        colors = np.where(is_fire[:, None], palette(fire, shades), palette(night, shades))
        widths = width * (0.6 + 0.8 * rng.random(count))
        for path, color, wide in zip(paths(points, centres), colors, widths, strict=True):
            stroke(draw, rng, path * full, color, wide * full)
    return np.asarray(canvas.resize((size, size), Image.Resampling.LANCZOS), dtype=np.float64) / 255


def stroke(
    draw: ImageDraw.ImageDraw, rng: np.random.Generator, path: np.ndarray, color: np.ndarray, width: float
) -> None:
    """One stroke of a few bristles, each of a shade of its own, along a path [P, 2] in pixels."""
    along = path[-1] - path[0]
    across = np.array([-along[1], along[0]]) / (np.linalg.norm(along) + 1e-9)
    for bristle in np.linspace(-0.5, 0.5, 5):
        shade = np.clip(color * (1 + 0.22 * rng.standard_normal()), 0, 1)
        points = [tuple(p) for p in path + bristle * width * across]
        draw.line(points, tuple((255 * shade).astype(int).tolist()), max(1, int(0.34 * width)))


def paths(points: np.ndarray, centres: np.ndarray) -> np.ndarray:
    """Ways [S, 10, 2] that follow the flow from points [S, 2]."""
    places = [points]
    for _ in range(9):
        places.append(places[-1] + 0.011 * flow(places[-1], centres))
    return np.stack(places, axis=1)


def flow(points: np.ndarray, centres: np.ndarray) -> np.ndarray:
    """Unit directions [S, 2] of the strokes: waves from left to right that turn around the centres."""
    away = points[:, None] - centres  # [S, 3, 2]
    near = np.exp(-(away**2).sum(2) / 0.02) / (np.linalg.norm(away, axis=2) + 1e-6)
    turn = (near[..., None] * np.stack([-away[..., 1], away[..., 0]], axis=2)).sum(1)
    wave = np.stack([np.ones(len(points)), 0.55 * np.cos(7 * points[:, 0] + 4 * points[:, 1])], axis=1)
    direction = 0.45 * wave + 2.2 * turn
    return direction / (np.linalg.norm(direction, axis=1, keepdims=True) + 1e-9)


def glass(size: int) -> np.ndarray:
    """Stained glass: glowing cells of many colours between dark strips of lead."""
    nearest, second, cell = voronoi(size, 90, seed=3)
    jewels = ["#b3122b", "#e2572b", "#f3b61f", "#1f8a5b", "#0f6fb0", "#28318f", "#6d2a8a", "#e7e0c0"]
    rng = np.random.default_rng(4)
    colors = palette(jewels, rng.random(90))[cell]
    streaks = 1.0 + 0.3 * fractal(size, 4, seed=8)[..., None]
    light = (1.12 - 0.5 * smoothstep(0.0, 0.09, nearest))[..., None]
    edge = second - nearest
    lead = smoothstep(0.006, 0.011, edge)[..., None]
    metal = 0.05 + 0.16 * np.exp(-((edge / 0.0035) ** 2))[..., None]
    return lead * colors * streaks * light + (1 - lead) * metal


def marble(size: int) -> np.ndarray:
    """Polished marble: cream and green clouds drawn into bands, with dark veins and threads of gold."""
    x, y = grid(size)
    bent = [0.13 * fractal(size, 4, seed) for seed in (1, 2)]
    bands = np.sin(11 * (0.8 * (x + bent[0]) + 0.6 * (y + bent[1])) + 2.2 * fractal(size, 3, seed=3))
    clouds = 0.5 + 0.38 * bands + 0.12 * fractal(size, 6, seed=4)
    stone = palette(["#f6f1e6", "#e6e1d2", "#c3ccbb", "#83a092", "#3f6157"], clouds)
    vein = np.abs(np.sin(5 * (x - y) + 9 * bent[1] + 1.6 * fractal(size, 5, seed=9)))
    dark = 0.85 * (1 - smoothstep(0.0, 0.07, vein))[..., None]
    thread = np.abs(np.sin(4 * (x + 0.5 * y) + 8 * bent[0] + 1.4 * fractal(size, 5, seed=21)))
    gold = (1 - smoothstep(0.012, 0.045, thread))[..., None]
    stone = stone * (1 - dark) + dark * np.array([0.08, 0.15, 0.14])
    metal = np.array([0.82, 0.62, 0.24]) * (0.8 + 0.35 * bands[..., None] ** 2)
    return stone * (1 - gold) + gold * metal


def weave(size: int) -> np.ndarray:
    """Cloth of thick threads over and under each other: indigo, madder and straw."""
    x, y = (32 * c for c in grid(size))
    over = ((np.floor(x) + np.floor(y)) % 2) == 0
    column, row = np.floor(x).astype(int), np.floor(y).astype(int)
    dyes = np.array([[0.12, 0.17, 0.36], [0.62, 0.18, 0.14], [0.86, 0.72, 0.42], [0.93, 0.89, 0.80]])
    pattern = np.array([0, 0, 0, 2, 1, 1, 2, 0, 0, 0, 3, 3])
    warp, weft = dyes[pattern[column % 12]], dyes[pattern[(row + 3) % 12]]
    along, across = np.where(over, y % 1, x % 1) - 0.5, np.where(over, x % 1, y % 1) - 0.5
    bulge = np.sqrt(np.clip(1 - (2.05 * across) ** 2, 0, 1)) * (0.62 + 0.38 * np.cos(np.pi * along))
    fibre = 0.09 * np.sin(2 * np.pi * (5 * across + 2.4 * along)) + 0.06 * fractal(size, 6, seed=14)
    return np.where(over[..., None], warp, weft) * (0.22 + 0.88 * bulge + fibre)[..., None]


def dots(size: int) -> np.ndarray:
    """Painted dots in rings around several middles, ochre, rust, teal and white on a dark ground."""
    rng = np.random.default_rng(7)
    full = OVERSAMPLED * size
    canvas = Image.new("RGB", (full, full), (46, 22, 18))
    draw = ImageDraw.Draw(canvas)
    paints = np.array([[242, 232, 207], [221, 160, 60], [196, 82, 38], [38, 118, 116], [240, 200, 120]])
    middles = np.array([[0.25, 0.3], [0.78, 0.2], [0.62, 0.75], [0.08, 0.85]])
    spacing = 0.034
    for index, middle in enumerate(middles):
        for ring in range(26):
            radius = spacing * ring
            count = max(1, round(2 * np.pi * radius / spacing))
            angles = 2 * np.pi * (np.arange(count) + 0.5 * (ring % 2)) / count
            points = middle + radius * np.stack([np.cos(angles), np.sin(angles)], 1)
            distance = np.linalg.norm(points[:, None] - middles, axis=2)
            for point in points[distance.argmin(1) == index]:
                size_of = full * spacing * (0.36 + 0.05 * rng.random())
                color = tuple(int(c) for c in paints[(ring + index) % 5])
                place = point * full + 1.2 * rng.standard_normal(2)
                draw.ellipse([*(place - size_of), *(place + size_of)], color)
    return np.asarray(canvas.resize((size, size), Image.Resampling.LANCZOS), dtype=np.float64) / 255


def waves(size: int) -> np.ndarray:
    """Rows of overlapping fans as on printed cloth: bands of indigo and white, with a line of vermilion."""
    x, y = grid(size)
    radius = 1 / 9
    color = np.ones((size, size, 3))
    for row in range(-1, 22):
        shift = 0.5 * (row % 2)
        u = ((x / radius + shift) % 1 - 0.5) * 2
        v = (y - row * radius / 2) / radius * 2
        distance = np.hypot(u, v - 1)
        inside = distance < 1
        band = smoothstep(0.42, 0.58, 0.5 + 0.5 * np.cos(2 * np.pi * 4 * distance))[..., None]
        paper, ink = np.array([0.95, 0.93, 0.87]), np.array([0.10, 0.19, 0.42])
        fan = band * paper + (1 - band) * ink
        heart = smoothstep(0.16, 0.2, distance)[..., None]
        fan = heart * fan + (1 - heart) * np.array([0.84, 0.26, 0.16])
        color = np.where(inside[..., None], fan, color)
    return color * (0.92 + 0.10 * fractal(size, 5, seed=17)[..., None])


PICTURES: dict[str, Callable[[int], np.ndarray]] = {
    "strokes": strokes,
    "glass": glass,
    "marble": marble,
    "weave": weave,
    "dots": dots,
    "waves": waves,
}
