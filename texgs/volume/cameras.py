"""Camera sets around the origin: an icosphere to learn from, a spiral to test on, an orbit to look at."""

from __future__ import annotations

from collections.abc import Sequence
from math import asin, atan2, degrees

from texgs.core.camera import Camera, orbit
from texgs.core.errors import ArgumentError
from texgs.core.lens import Lens
from texgs.volume.geodesic import frequency_of, geodesic_vertices

POLE = 89.99  # degrees; the paper's views stop short of the poles, so that +y is up in every one of them
FRONT = -90.0  # azimuth of +z, degrees


def icosphere(frequency: int, radius: float, fov_y: float, width: int, height: int) -> list[Camera]:
    """Cameras on the vertices of a geodesic icosphere, looking at the origin: the paper's training views.

    From the bottom to the top (+y), and by azimuth from -180 to 180 degrees where several are at one
    height: the order of the views published with the paper.

    Args:
        frequency: parts f that each edge of the icosahedron is split into, at least 1; 10 f^2 + 2 cameras.
        radius: distance from the origin, world units.
        fov_y: vertical field of view, degrees.
        width: pixels.
        height: pixels.

    Raises:
        ArgumentError: if an argument is out of range.
    """
    if frequency < 1:
        raise ArgumentError(f"frequency: expected at least 1, got {frequency}")
    angles = [(degrees(asin(y)), degrees(atan2(-z, x))) for x, y, z in geodesic_vertices(frequency).tolist()]
    # Rounded, because heights that are equal by symmetry differ in the last bit.
    angles.sort(key=lambda pair: (round(pair[0], 9), pair[1]))
    return [_orbit(azimuth, polar, radius, fov_y, width, height) for polar, azimuth in angles]


def icosphere_of(count: int, lens: Lens, where: str = "views") -> list[Camera]:
    """The icosphere with so many cameras, 10 f^2 + 2 for some frequency f.

    Raises:
        ArgumentError: naming where the number comes from, if no icosphere has so many.
    """
    return icosphere(frequency_of(count, where), *lens)


def spiral(count: int, radius: float, fov_y: float, width: int, height: int) -> list[Camera]:
    """Cameras on a spiral from below to above that turns once, looking at the origin: the paper's test views.

    View i is at azimuth -180 + 360 i / (count - 1) and polar angle -90 + 180 i / (count - 1) degrees, with
    polar angles kept 0.01 degrees off the poles.

    Args:
        count: number of cameras, at least 2; the paper has 181.
        radius: distance from the origin, world units.
        fov_y: vertical field of view, degrees.
        width: pixels.
        height: pixels.

    Raises:
        ArgumentError: if an argument is out of range.
    """
    if count < 2:
        raise ArgumentError(f"count: expected at least 2 cameras on a path from pole to pole, got {count}")
    steps = [index / (count - 1) for index in range(count)]
    return [_orbit(-180 + 360 * t, -90 + 180 * t, radius, fov_y, width, height) for t in steps]


def orbit_path(
    count: int, polar: float, radius: float, fov_y: float, width: int, height: int, start: float = FRONT
) -> list[Camera]:
    """Cameras on one turn around +y that does not repeat its start.

    Args:
        count: number of cameras, at least 1.
        polar: degrees above the horizon, -90 to 90.
        radius: distance from the origin, world units.
        fov_y: vertical field of view, degrees.
        width: pixels.
        height: pixels.
        start: azimuth of the first camera, degrees; by default it is in front (+z, for polar 0).

    Raises:
        ArgumentError: if an argument is out of range.
    """
    if count < 1:
        raise ArgumentError(f"count: expected at least 1 camera, got {count}")
    turn = [start + 360 * index / count for index in range(count)]
    return [orbit(azimuth, polar, radius, fov_y, width, height) for azimuth in turn]


def spread(cameras: Sequence[Camera], count: int) -> list[Camera]:
    """So many cameras of a path, evenly spread over it and in its order; all, if it has no more."""
    count = min(count, len(cameras))
    return [cameras[index * len(cameras) // count] for index in range(count)]


def _orbit(azimuth: float, polar: float, radius: float, fov_y: float, width: int, height: int) -> Camera:
    """Camera with +y up everywhere, as the paper has them at the poles."""
    return orbit(azimuth, max(-POLE, min(POLE, polar)), radius, fov_y, width, height)
