"""Transfer functions: what colour and opacity a scalar value has; and basic ones, which share a volume."""

import math
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from texgs.core.errors import ArgumentError

Array = NDArray[np.float64]

MAX_FLOAT = sys.float_info.max


@dataclass(frozen=True)
class TransferFunction:
    """Scalar value -> colour and opacity, piecewise linear.

    Points are sorted by value; two points at one value are a step, and the second holds at that value.
    Opacity is 0 outside its points (a step there says nothing more: its outer point is dropped), colour is
    constant outside its points.

    Raises:
        ArgumentError: naming the point that is malformed, not finite, out of order or out of range; or if
            opacity is 0 everywhere.
    """

    opacity: tuple[tuple[float, float], ...]  # at least two (value, opacity in [0, 1] per opacity unit)
    color: tuple[tuple[float, float, float, float], ...]  # at least one (value, r, g, b), linear, in [0, 1]
    channel: int = 0  # of the volume, whose values these are
    within: int | None = None  # channel with the mask of a label, outside which nothing shows

    def __post_init__(self) -> None:
        # Lists, as they come from files, become tuples of floats.
        opacity = _points("opacity", self.opacity, "opacity", 2)
        first, last = opacity[0][0] == opacity[1][0], opacity[-1][0] == opacity[-2][0]
        object.__setattr__(self, "opacity", opacity[first : len(opacity) - last])
        object.__setattr__(self, "color", _points("color", self.color, "r, g, b", 1))
        low, high = self.support
        if not low < high:
            raise ArgumentError("opacity: expected some values with opacity above 0, got none; raise a point")
        for name, number in (("channel", self.channel), ("within", self.within)):
            if (name, number) != ("within", None) and (type(number) is not int or number < 0):
                raise ArgumentError(f"{name}: expected a number from 0 on, got {number!r:.100}")

    @property
    def source(self) -> tuple[int, int | None]:
        """Return what it is a function of: a channel, as a whole or within a mask."""
        return self.channel, self.within

    @property
    def support(self) -> tuple[float, float]:
        """Return the smallest closed range of values outside which opacity is 0."""
        visible = [i for i, (_, opacity) in enumerate(self.opacity) if opacity > 0]
        if not visible:
            return (0.0, 0.0)
        first, last = max(visible[0] - 1, 0), min(visible[-1] + 1, len(self.opacity) - 1)
        return self.opacity[first][0], self.opacity[last][0]

    def __call__(self, values: ArrayLike) -> Array:
        """Return r, g, b and opacity in [0, 1] [..., 4], straight alpha, of values [...] in data units.

        NaN is transparent.
        """
        values = np.asarray(values, dtype=np.float64)
        opacity = right_limit(self.opacity, values)  # [..., 1]
        outside = (values < self.opacity[0][0]) | (values > self.opacity[-1][0])
        opacity[outside] = 0
        return np.nan_to_num(np.concatenate([right_limit(self.color, values), opacity], axis=-1))

    def scaled(self, low: float, high: float) -> "TransferFunction":
        """Map a function given on fractions of the data range to data values: 0 -> low, 1 -> high."""
        for name, points in (("opacity", self.opacity), ("color", self.color)):
            for i, (fraction, *_) in enumerate(points):
                if not 0 <= fraction <= 1:
                    raise ArgumentError(
                        f"{name}[{i}]: expected a fraction of the data range in [0, 1], got {fraction:g}; "
                        "do not scale a transfer function that is in data values"
                    )

        return self.with_values(lambda t: (1 - t) * low + t * high)

    def in_support(self) -> "TransferFunction":
        """Return the function without points outside its support, where it is transparent."""
        low, high = self.support
        return self.with_points(_cut(self.opacity, low, high), _cut(self.color, low, high))

    def with_values(self, of: Callable[[float], float]) -> "TransferFunction":
        """Return the function whose points are at other values, in the same order."""
        opacity, color = (
            [(of(value), *rest) for value, *rest in each] for each in (self.opacity, self.color)
        )
        return self.with_points(opacity, color)

    def with_points(self, opacity: Any, color: Any) -> "TransferFunction":
        """Return the function of other points for the same channel."""
        return replace(self, opacity=opacity, color=color)

    def rounded(self, low: float, high: float) -> "TransferFunction":
        """Return the function with numbers that are short to read and keep a millionth of a range of data."""
        digits = 6 + math.ceil(math.log10(max(max(abs(low), abs(high)) / (high - low), 1)))
        opacity, color = (
            [[float(f"{x:.{digits}g}") for x in point] for point in points]
            for points in (self.opacity, self.color)
        )
        return self.with_points(opacity, color)

    def without_steps(self, ramp: float | None = None) -> "TransferFunction":
        """Return the same function with strictly ascending points and opacity 0 at both ends.

        For programs that extend the end points to all values and know no steps, such as VTK. A step becomes
        a ramp just below its value, so that it still holds at the value: as wide as `ramp`, by default a
        millionth of the range of the points, and never more than a quarter of the distance between two.
        """
        values = np.unique([value for value, *_ in (*self.opacity, *self.color)])
        ramp = 1e-6 * float(values[-1] - values[0]) if ramp is None else ramp
        gap = min(ramp, float(np.diff(values).min()) / 4)

        def ramps(points: Sequence[tuple[float, ...]]) -> Any:
            following = [*(point[0] for point in points[1:]), None]
            return [
                (value - gap, *rest) if value == after else (value, *rest)
                for (value, *rest), after in zip(points, following, strict=True)
            ]

        opacity = list(self.opacity)
        if opacity[0][1] > 0:
            opacity.insert(0, (opacity[0][0], 0.0))
        if opacity[-1][1] > 0:
            opacity.append((opacity[-1][0] + gap, 0.0))
        return self.with_points(ramps(opacity), ramps(self.color))

    def to_dict(self) -> dict[str, Any]:
        """Return the points as lists, ready for JSON or YAML, a channel that is not the first, and a mask."""
        points = {"opacity": [list(p) for p in self.opacity], "color": [list(p) for p in self.color]}
        mask = {} if self.within is None else {"within": self.within}
        return points | ({"channel": self.channel} if self.channel else {}) | mask

    @staticmethod
    def from_dict(data: Mapping[str, Any]) -> "TransferFunction":
        """Return the function of such lists."""
        if not isinstance(data, Mapping) or set(data) - {"channel", "within"} != {"opacity", "color"}:
            keys = ", ".join(map(str, data)) if isinstance(data, Mapping) else type(data).__name__
            raise ArgumentError(f"transfer function: expected the keys opacity, color, got {keys or 'none'}")
        return TransferFunction(data["opacity"], data["color"], data.get("channel", 0), data.get("within"))


def right_limit(points: Sequence[tuple[float, ...]], values: Array) -> Array:
    """Interpolate [..., C] linearly, constant outside the points; at a step the second point holds."""
    table = np.array(points)
    columns = [np.interp(values, table[:, 0], column) for column in table[:, 1:].T]
    return np.clip(np.stack(columns, axis=-1), 0, 1)  # rounding may leave [0, 1]


def left_limit(points: Sequence[tuple[float, ...]], values: Array) -> Array:
    """Interpolate as `right_limit` does, but at a step the first point holds: mirrored, it is the second."""
    return right_limit([(-value, *rest) for value, *rest in reversed(points)], -values)


def _points(name: str, points: Any, channels: str, least: int) -> tuple[tuple[float, ...], ...]:
    """Return points as tuples of floats, checked one by one."""
    if not isinstance(points, Iterable):
        raise ArgumentError(f"{name}: expected a list of points (value, {channels}), got {points!r}")
    rows = [tuple(point) if isinstance(point, Iterable) else (point,) for point in points]
    if len(rows) < least:
        raise ArgumentError(f"{name}: expected at least {least} points, got {len(rows)}")
    for i, row in enumerate(rows):
        where = f"{name}[{i}]"
        if len(row) != channels.count(",") + 2 or not all(isinstance(x, Real) for x in row):
            raise ArgumentError(f"{where}: expected the numbers (value, {channels}), got {row_text(row)}")
        if not all(-MAX_FLOAT <= x <= MAX_FLOAT for x in row):
            raise ArgumentError(f"{where}: expected finite numbers, got {row_text(row)}")
        if not all(0 <= x <= 1 for x in row[1:]):
            raise ArgumentError(f"{where}: expected {channels} in [0, 1], got {row_text(row[1:])}")
        if i > 0 and row[0] < rows[i - 1][0]:
            raise ArgumentError(
                f"{where}: expected ascending values, got {row[0]:.9g} after {rows[i - 1][0]:.9g}; sort them"
            )
        if i > 1 and row[0] == rows[i - 2][0]:
            raise ArgumentError(f"{where}: expected at most two points at a value, got three at {row[0]:.9g}")
    return tuple(tuple(map(float, row)) for row in rows)


def row_text(row: Iterable[Any]) -> str:
    """Return a point or range as people write it."""
    return f"({', '.join(f'{x:.9g}' if isinstance(x, float) else repr(x) for x in row)})"


def combine(basic: Mapping[str, TransferFunction]) -> TransferFunction:
    """Combine the disjoint basic transfer functions of a channel into one."""
    if not basic:
        raise ArgumentError("transfer functions: expected at least one, got none")
    check_disjoint(basic)
    opacity: list[tuple[float, ...]] = []
    color: list[tuple[float, ...]] = []
    end = 0.0  # end of the functions so far
    for tf in sorted(basic.values(), key=lambda each: each.support):
        low, high = tf.support
        points = _cut(tf.opacity, low, high)
        if not opacity or opacity[-1][0] < low:  # transparent between two, also where one ends in a step
            points = [(low, 0.0), *points] if points[0][1] > 0 else points
            opacity += [(end, 0.0)] if opacity and opacity[-1][1] > 0 and end < low else []
        opacity += points
        end = just_above(high) if tf(high)[3] > 0 else high
        color += _cut(tf.color, low, high)
    return tf.with_points(opacity, color)


def just_above(value: float) -> float:
    """Return the next number in single precision: a function whose opacity ends above 0 holds at its end.

    Next to 0 it is one whose difference has a finite inverse, which the caster multiplies with.
    """
    single, least = np.float32(value), np.finfo(np.float32).tiny
    return float(max(np.nextafter(single, np.float32(np.inf)), single + least))


def check_disjoint(basic: Mapping[str, TransferFunction]) -> None:
    """Require that no value of a channel is visible in two basic transfer functions; ranges may touch."""
    if pair := overlapping(basic):
        one, two = (row_text(basic[name].support) for name in pair)
        raise ArgumentError(
            f"{' and '.join(pair)}: expected ranges of values that do not overlap, got {one} and {two}; cut "
            "one of them"
        )


def overlapping(functions: Mapping[str, TransferFunction]) -> tuple[str, str] | None:
    """Return the names of the first two functions that both show some values, if there are such."""
    for (name, tf), (other_name, other) in combinations(functions.items(), 2):
        one, two = tf.support, other.support
        if tf.source == other.source and max(one[0], two[0]) < min(one[1], two[1]):
            return name, other_name
    return None


def _cut(points: Sequence[tuple[float, ...]], low: float, high: float) -> list[tuple[float, ...]]:
    """Return the points between two values, and the limits at them from inside."""
    inside = [point for point in points if low < point[0] < high]
    start, end = right_limit(points, np.array(low)), left_limit(points, np.array(high))
    return [(low, *start.tolist()), *inside, (high, *end.tolist())]
