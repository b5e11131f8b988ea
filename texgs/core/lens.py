"""What cameras around the origin have in common."""

from __future__ import annotations

from typing import NamedTuple


class Lens(NamedTuple):
    """Distance, field of view and size of images; the defaults are those of the paper's views."""

    radius: float = 4.0311  # distance from the origin, world units
    fov_y: float = 30.0  # vertical, degrees
    width: int = 800  # pixels
    height: int = 800  # pixels

    def square(self, size: int) -> Lens:
        """Return the same for square images."""
        return self._replace(width=size, height=size)
