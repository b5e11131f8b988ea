"""Evenly spaced directions: the vertices of a geodesic icosphere, how many there are and where."""

from __future__ import annotations

from itertools import combinations, product
from math import isqrt, sqrt

import numpy as np

from texgs.core.errors import ArgumentError


def frequency_of(count: int, where: str = "views") -> int:
    """The frequency f of the icosphere that has so many vertices, 10 f^2 + 2.

    Args:
        count: of vertices.
        where: the number comes from, for the message.

    Raises:
        ArgumentError: if no icosphere has so many.
    """
    frequency = isqrt(max(count - 2, 0) // 10)
    if frequency < 1 or 10 * frequency**2 + 2 != count:
        raise ArgumentError(f"{where}: expected 12, 42, 92, 162 or another 10 f^2 + 2, got {count}")
    return frequency


def geodesic_vertices(frequency: int) -> np.ndarray:
    """Unit vectors [10 f^2 + 2, 3], float64: the faces of an icosahedron split into f^2 triangles each.

    Points are evenly spaced on the flat faces and then moved to the sphere. The edges nearest the poles
    (+-y) run along z.
    """
    corners = _icosahedron()
    # Neighbours are 2 apart, all others more than 3.
    edges = [(a, b) for a, b in combinations(corners, 2) if np.linalg.norm(a - b) < 3]
    faces = [
        (a, b, c)
        for a, b, c in combinations(corners, 3)
        if max(np.linalg.norm(a - b), np.linalg.norm(b - c), np.linalg.norm(c - a)) < 3
    ]
    f = frequency
    inner = [(i, j) for i, j in product(range(1, f), repeat=2) if i + j < f]
    points = [
        *corners,
        *(i * a + (f - i) * b for a, b in edges for i in range(1, f)),
        *(i * a + j * b + (f - i - j) * c for a, b, c in faces for i, j in inner),
    ]
    vertices = np.stack(points)
    return vertices / np.linalg.norm(vertices, axis=1, keepdims=True)


def _icosahedron() -> list[np.ndarray]:
    """The 12 corners, edge length 2: three golden rectangles.

    The lower half is the negative of the upper one down to the sign of zero: on the -x half plane that sign
    decides between azimuth -180 and 180, and the published order of views follows from it.
    """
    golden = (1 + sqrt(5)) / 2
    half = [
        (0, golden, 1), (0, golden, -1), (golden, 1, 0), (-golden, 1, 0), (1, 0, golden), (-1, 0, golden)
    ]  # fmt: skip
    upper = [np.array(corner, dtype=np.float64) for corner in half]
    return [*upper, *(-corner for corner in upper)]
