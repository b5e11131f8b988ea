"""What cameras around the origin have in common."""

from __future__ import annotations

from math import isqrt
from typing import NamedTuple

from texgs.core.errors import ArgumentError


class Lens(NamedTuple):
    """Distance, field of view and size of images; the defaults are those of the paper's views."""

    radius: float = 4.0311  # distance from the origin, world units
    fov_y: float = 30.0  # vertical, degrees
    width: int = 800  # pixels
    height: int = 800  # pixels

    def square(self, size: int) -> Lens:
        """Return the same for square images."""
        return self._replace(width=size, height=size)


def frequency_of(count: int, where: str = "views") -> int:
    """Return the frequency f of the icosphere that has so many vertices, 10 f^2 + 2."""
    frequency = isqrt(max(count - 2, 0) // 10)
    if frequency < 1 or 10 * frequency**2 + 2 != count:
        raise ArgumentError(f"{where}: expected 12, 42, 92, 162 or another 10 f^2 + 2, got {count}")
    return frequency
