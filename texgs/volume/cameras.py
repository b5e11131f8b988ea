"""Camera sets around a target: an icosphere to learn from, a spiral to test on, an orbit to look at."""

from collections.abc import Sequence
from itertools import combinations, product
from math import asin, atan2, degrees, sqrt
from typing import TypeVar

import numpy as np
import torch

from texgs.core.camera import Camera, orbit
from texgs.core.errors import ArgumentError
from texgs.core.lens import FRONT, SIGHTS, Lens, frequency_of

POLE = 89.99  # degrees; the paper's views stop short of the poles, so that +y is up in every one of them
T = TypeVar("T")


def icosphere(frequency: int, lens: Lens) -> list[Camera]:
    """Return cameras on a geodesic icosphere, looking at its middle: the paper's training views.

    From the bottom to the top (+y), and by azimuth from -180 to 180 degrees where several are at one
    height: the order of the views published with the paper. There are 10 f^2 + 2 of them, `frequency` f being
    the parts that each edge of the icosahedron is split into.
    """
    angles = [(degrees(asin(y)), degrees(atan2(-z, x))) for x, y, z in geodesic_vertices(frequency).tolist()]
    # Rounded, because heights that are equal by symmetry differ in the last bit.
    angles.sort(key=lambda pair: (round(pair[0], 9), pair[1]))
    return [_orbit(azimuth, polar, lens) for polar, azimuth in angles]


def icosphere_of(count: int, lens: Lens, where: str = "views") -> list[Camera]:
    """Return the icosphere with so many cameras, 10 f^2 + 2 for some frequency f; see `frequency_of`."""
    return icosphere(frequency_of(count, where), lens)


def spiral(count: int, lens: Lens, where: str = "count") -> list[Camera]:
    """Return cameras on a spiral from below to above that turns once, looking inwards: the test views.

    View i is at azimuth -180 + 360 i / (count - 1) and polar angle -90 + 180 i / (count - 1) degrees, with
    polar angles kept 0.01 degrees off the poles. The paper has 181 of them.
    """
    if count < 2:
        raise ArgumentError(f"{where}: expected at least 2 cameras on a path from pole to pole, got {count}")
    steps = [index / (count - 1) for index in range(count)]
    return [_orbit(-180 + 360 * t, -90 + 180 * t, lens) for t in steps]


def orbit_path(count: int, polar: float, lens: Lens, start: float = FRONT) -> list[Camera]:
    """Return cameras on one turn around +y that does not repeat its start.

    They are `polar` degrees above the horizon, the first at the azimuth `start`: by default in front (+z, for
    polar 0).
    """
    turn = [start + 360 * index / count for index in range(count)]
    return [orbit(azimuth, polar, *lens) for azimuth in turn]


def sights(lens: Lens) -> dict[str, Camera]:
    """Return the cameras of `SIGHTS` by name."""
    return {name: orbit(azimuth, polar, *lens) for name, (azimuth, polar) in SIGHTS.items()}


def spread(path: Sequence[T], count: int) -> list[T]:
    """Return `count` evenly spread cameras or views of a path in order, or all if there are no more."""
    count = min(count, len(path))
    return [path[index * len(path) // count] for index in range(count)]


def farthest_first(cameras: Sequence[Camera]) -> list[int]:
    """Return the places of all cameras, each the farthest from those before it: any first few are spread."""
    positions = torch.stack([camera.position for camera in cameras]).double()
    apart = torch.cdist(positions, positions)  # [V, V]
    order, nearest = [0], apart[0]
    for _ in cameras[1:]:
        nearest = nearest.index_fill(0, torch.tensor(order), -1)  # each is taken once
        order.append(int(nearest.argmax()))
        nearest = torch.minimum(nearest, apart[order[-1]])
    return order


def _orbit(azimuth: float, polar: float, lens: Lens) -> Camera:
    """Return a camera with +y up everywhere, also at the poles, as in the paper."""
    return orbit(azimuth, max(-POLE, min(POLE, polar)), *lens)


def geodesic_vertices(frequency: int) -> np.ndarray:
    """Return unit vectors [10 f^2 + 2, 3]: the faces of an icosahedron split into f^2 triangles each.

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
    """Return the 12 corners, edge length 2: three golden rectangles.

    The lower half is the negative of the upper one down to the sign of zero: on the -x half plane that sign
    decides between azimuth -180 and 180, and the published order of views follows from it.
    """
    golden = (1 + sqrt(5)) / 2
    half = [
        (0, golden, 1), (0, golden, -1), (golden, 1, 0), (-golden, 1, 0), (1, 0, golden), (-1, 0, golden)
    ]  # fmt: skip
    upper = [np.array(corner, dtype=np.float64) for corner in half]
    return [*upper, *(-corner for corner in upper)]
