"""Cuts of a scene: planes and a box that remove everything beyond them, in world units."""

from dataclasses import dataclass, field
from itertools import product
from math import hypot

from texgs.core.errors import ArgumentError
from texgs.core.keys import REQUIRED, key
from texgs.core.names import check_window

AXES = "xyz"
FACES = ("shaded", "unlit", "slice")
MAX_PLANES = 6
LENGTH_TOLERANCE = 1e-9  # deviation from length 1 that is not normalised, so that planes survive a round trip
MAX_COORDINATE = 1e6  # world units; float32 holds such coordinates


@dataclass(frozen=True)
class Plane:
    """Keeps the points x with normal . x <= offset; the normal is normalised."""

    normal: list[float] = key(
        REQUIRED, "[3], points to what is taken away", least=-MAX_COORDINATE, most=MAX_COORDINATE
    )
    offset: float = key(
        0.0, "from the origin along the normal", "world units", least=-MAX_COORDINATE, most=MAX_COORDINATE
    )

    def __post_init__(self) -> None:
        length = hypot(*self.normal)
        if len(self.normal) != 3 or length < 1 / MAX_COORDINATE:
            raise ArgumentError(f"normal: expected three numbers that are not all 0, got {self.normal}")
        if abs(length - 1) > LENGTH_TOLERANCE:
            object.__setattr__(self, "normal", [each / length for each in self.normal])
            object.__setattr__(self, "offset", self.offset / length)
        if not abs(self.offset) <= MAX_COORDINATE:
            raise ArgumentError(
                f"offset: expected at most {MAX_COORDINATE:g} world units along the unit normal, "
                f"got {self.offset:g}"
            )


@dataclass(frozen=True)
class Box:
    """Keeps the points between two corners; its sides follow the world axes."""

    low: list[float] = key(REQUIRED, "corner [3]", "world units", least=-MAX_COORDINATE, most=MAX_COORDINATE)
    high: list[float] = key(REQUIRED, "corner [3]", "world units", least=-MAX_COORDINATE, most=MAX_COORDINATE)

    def __post_init__(self) -> None:
        is_box = len(self.low) == len(self.high) == 3
        if not is_box or not all(low < high for low, high in zip(self.low, self.high, strict=True)):
            raise ArgumentError(
                f"box: expected two corners of three numbers, low below high, got {self.low} and {self.high}"
            )

    @property
    def planes(self) -> list[Plane]:
        """Return the planes of the six sides."""
        sides = product(range(3), ((1.0, self.high), (-1.0, self.low)))
        return [Plane(along(axis, sign), sign * corner[axis]) for axis, (sign, corner) in sides]


@dataclass(frozen=True)
class Cuts:
    """The visible part of a scene: the intersection of all planes and the box."""

    planes: list[Plane] = field(default_factory=list)
    box: Box | None = None
    faces: str = key("shaded", "by the normal of the plane, unlit, or a slice in grey", choices=FACES)
    window: tuple[float, float] | None = key(None, "values in black and in white, of slices")

    def __post_init__(self) -> None:
        if len(self.planes) > MAX_PLANES:
            raise ArgumentError(f"planes: expected at most {MAX_PLANES}, got {len(self.planes)}")
        check_window(self.window)

    def __bool__(self) -> bool:
        """Return whether there is any cut."""
        return bool(self.planes or self.box)

    @property
    def half_spaces(self) -> list[Plane]:
        """Return all planes, ending with those of the box."""
        return [*self.planes, *(self.box.planes if self.box else ())]


NO_CUTS = Cuts()


def along(axis: int, sign: float = 1.0) -> list[float]:
    """Return the unit vector along an axis, 0 to 2, or against it with sign -1."""
    return [sign * (axis == each) for each in range(3)]
