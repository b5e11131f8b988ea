"""Patterns that pictures are made of: smooth noise, cells, colours along a scale."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

CELLS = 4  # of the coarsest octave along each side


def grid(size: int) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates x and y [size, size] of pixel centres in [0, 1]."""
    centres = (np.arange(size) + 0.5) / size
    x, y = np.meshgrid(centres, centres)
    return x, y


def smoothstep(low: float, high: float, x: np.ndarray) -> np.ndarray:
    """0 below `low`, 1 above `high`, smooth in between."""
    t = ((x - low) / (high - low)).clip(0, 1)
    return t * t * (3 - 2 * t)


def fractal(size: int, octaves: int, seed: int) -> np.ndarray:
    """Sum of value noise of rising frequency [size, size], about -1 to 1."""
    rng = np.random.default_rng(seed)
    total = np.zeros((size, size))
    for octave in range(octaves):
        cells = CELLS * 2**octave
        total += lattice(rng.uniform(-1, 1, (cells + 1, cells + 1)), size) / 2**octave
    return total


def lattice(values: np.ndarray, size: int) -> np.ndarray:
    """Values at the corners of cells, interpolated smoothly to [size, size] pixels."""
    at = (np.arange(size) + 0.5) / size * (len(values) - 1)
    cell = at.astype(int)
    t = smoothstep(0, 1, at - cell)
    rows = values[cell] * (1 - t)[:, None] + values[cell + 1] * t[:, None]
    return rows[:, cell] * (1 - t) + rows[:, cell + 1] * t


def voronoi(size: int, count: int, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Distance to the nearest and the second nearest of `count` points, and which one is nearest."""
    from scipy.spatial import cKDTree

    rng = np.random.default_rng(seed)
    x, y = grid(size)
    bent = np.stack([x + 0.012 * fractal(size, 3, seed + 1), y + 0.012 * fractal(size, 3, seed + 2)], axis=2)
    distance, index = cKDTree(rng.random((count, 2))).query(bent.reshape(-1, 2), k=2)
    return (
        distance[:, 0].reshape(size, size),
        distance[:, 1].reshape(size, size),
        index[:, 0].reshape(size, size),
    )


def palette(colors: Sequence[str], place: np.ndarray) -> np.ndarray:
    """Colours [..., 3] in [0, 1] along a scale of hexadecimal ones, for places in [0, 1]."""
    table = np.array([[int(color[i : i + 2], 16) / 255 for i in (1, 3, 5)] for color in colors])
    at = place.clip(0, 1) * (len(table) - 1)
    low = np.minimum(at.astype(int), len(table) - 2)
    return table[low] + (table[low + 1] - table[low]) * (at - low)[..., None]
