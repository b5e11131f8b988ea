"""Markers of a scene: points with a text, and distances between two points, in world units."""

from dataclasses import dataclass
from math import dist

from texgs.core.cuts import MAX_COORDINATE
from texgs.core.errors import ArgumentError
from texgs.core.keys import REQUIRED, key

MAX_MARKERS = 100
MAX_LETTERS = 200  # of a text
Point = tuple[float, float, float]


@dataclass(frozen=True)
class Marker:
    """A point of the world, or a distance between two of them, with a text."""

    points: tuple[Point, ...] = key(
        REQUIRED,
        "one, or both ends of a distance",
        "world units",
        items=(1, 2),
        least=-MAX_COORDINATE,
        most=MAX_COORDINATE,
    )
    text: str = key("", "beside it")

    def __post_init__(self) -> None:
        if len(self.text) > MAX_LETTERS or not self.text.isprintable():
            raise ArgumentError(
                f"text of a marker: expected at most {MAX_LETTERS} printable letters, "
                f"got {self.text[: MAX_LETTERS + 1]!r}"
            )

    @property
    def length(self) -> float:
        """Return the distance between its points in world units; 0 of one."""
        return dist(self.points[0], self.points[-1])


@dataclass(frozen=True)
class Markers:
    """The markers of a scene as a value of its file, for checks."""

    markers: tuple[Marker, ...] = key((), "in the order that they were made", items=(0, MAX_MARKERS))
