"""What cameras around a target have in common, and how far away they show all that is visible."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isqrt, radians, sqrt, tan
from typing import Literal, NamedTuple, Self

from texgs.core.cuts import MAX_COORDINATE
from texgs.core.errors import ArgumentError
from texgs.core.keys import REQUIRED, key
from texgs.core.names import require_numbers

ORIGIN = (0.0, 0.0, 0.0)
FRONT = -90.0  # azimuth of +z, degrees
# Azimuth and polar angle of three views that are far apart, degrees. Their heights differ, too: what is round
# about +y looks alike from all sides.
SIGHTS = {"front": (FRONT, 20.0), "below": (30.0, -30.0), "above": (150.0, 50.0)}
FILL_SHARE = 0.9  # share of the smaller side of an image that shows what is framed


class Lens(NamedTuple):
    """Distance, field of view, size of images and target; the defaults are those of the paper's views."""

    radius: float = 4.0311  # distance from the target, world units
    fov_y: float = 30.0  # vertical, degrees
    width: int = 800  # pixels
    height: int = 800  # pixels
    target: Sequence[float] = ORIGIN  # [3], that cameras look at, world units

    def square(self, size: int) -> Self:
        """Return the same for square images."""
        return self._replace(width=size, height=size)


@dataclass(frozen=True)
class Frame:
    """What cameras look at: the ball of what is visible."""

    target: list[float] = key(
        REQUIRED, "its centre [3]", "world units", least=-MAX_COORDINATE, most=MAX_COORDINATE
    )
    radius: float = key(REQUIRED, "its radius", "world units", above=0, most=MAX_COORDINATE)
    azimuth: float = key(30.0, "of the camera that sees it first", "degrees", least=-360, most=360)

    def __post_init__(self) -> None:
        if len(self.target) != 3:
            raise ArgumentError(f"target: expected three numbers, got {self.target}")

    def lens(
        self,
        fov_y: float = Lens().fov_y,
        width: int = 800,
        height: int = 800,
        radius: float | None = None,
        target: Sequence[float] | None = None,
    ) -> Lens:
        """Return the lens that shows the ball on 90 % of the smaller side of images.

        Distance and target may be others.

        The silhouette of a ball of radius r at distance d is a disc whose tangent is r / sqrt(d^2 - r^2).
        """
        require_numbers(fov_y=fov_y, width=width, height=height)
        if not 0 < fov_y < 180:
            raise ArgumentError(f"fov_y: expected degrees between 0 and 180, got {fov_y}")
        tangent = FILL_SHARE * tan(radians(0.5 * fov_y)) * min(1.0, max(width, 1) / max(height, 1))
        distance = self.radius * sqrt(1 + tangent**-2) if radius is None else radius
        return Lens(distance, fov_y, width, height, self.target if target is None else target)


@dataclass(frozen=True)
class LensKeys:
    """Size of pictures, and where the camera looks, from how far and how wide."""

    width: int = key(800, "of pictures", "pixels", least=1)
    height: int | None = key(None, "of pictures; default the width", "pixels", least=1)
    fov_y: float = key(30.0, "vertical field of view", "degrees", above=0, below=180, option="fov")
    radius: float | None = key(None, "distance from the target; default by the frame", "world units", above=0)
    target: tuple[float, float, float] | None = key(
        None,
        "what the camera looks at; default the middle of the frame",
        "world units",
        least=-MAX_COORDINATE,
        most=MAX_COORDINATE,
    )
    frame: Literal["scene", "paper"] = key(
        "scene", "what is centred on 90 % of the picture; paper: cameras 4.0311 from the origin"
    )

    def lens(self, framed: Frame) -> Lens:
        """Return the lens that shows what is framed, unless a distance or a target says otherwise."""
        size = self.width, self.width if self.height is None else self.height
        if self.frame == "scene":
            return framed.lens(self.fov_y, *size, self.radius, self.target)
        return Lens(self.radius or Lens().radius, self.fov_y, *size, self.target or ORIGIN)


def frequency_of(count: int, where: str = "views") -> int:
    """Return the frequency f of the icosphere that has so many vertices, 10 f^2 + 2."""
    frequency = isqrt(max(count - 2, 0) // 10)
    if frequency < 1 or 10 * frequency**2 + 2 != count:
        raise ArgumentError(f"{where}: expected 12, 42, 92, 162 or another 10 f^2 + 2, got {count}")
    return frequency
