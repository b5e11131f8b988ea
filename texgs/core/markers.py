"""Markers of a scene: points with a text, and distances between two points, in world units."""

from dataclasses import dataclass

from texgs.core.cuts import MAX_COORDINATE as MOST
from texgs.core.errors import ArgumentError
from texgs.core.keys import REQUIRED, key

MAX_MARKERS = 100
MAX_LETTERS = 200  # of a text
Point = tuple[float, float, float]


@dataclass(frozen=True)
class Marker:
    """A point of the world, or both ends of a distance, with a text."""

    points: tuple[Point, ...] = key(REQUIRED, "1 or 2", "world units", items=(1, 2), least=-MOST, most=MOST)
    text: str = key("", "beside it")

    def __post_init__(self) -> None:
        if len(self.text) > MAX_LETTERS or not self.text.isprintable():
            expected = f"expected at most {MAX_LETTERS} printable letters"
            raise ArgumentError(f"text of a marker: {expected}, got {self.text[: MAX_LETTERS + 1]!r}")


@dataclass(frozen=True)
class Markers:
    """The markers of a scene, to check those of files and messages."""

    markers: tuple[Marker, ...] = key((), "in the order in which they were made", items=(0, MAX_MARKERS))
