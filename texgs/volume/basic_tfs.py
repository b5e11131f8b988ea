"""Basic transfer functions: parts of one that share a volume, each with a range of values of its own."""

from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Any

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.volume.transfer import TransferFunction, check_range, right_limit, row_text


def split(tf: TransferFunction, ranges: Sequence[tuple[float, float]]) -> list[TransferFunction]:
    """Cut a transfer function into basic ones.

    Inside each open range the basic function equals the whole, outside the closed range it is transparent.

    Args:
        tf: the whole.
        ranges: (low, high) per basic function, in data units; they may touch but not overlap.
    """
    for i, range_ in enumerate(ranges):
        check_range(f"ranges[{i}]", range_)
    _check_no_overlap({f"ranges[{i}]": range_ for i, range_ in enumerate(ranges)})
    basic = []
    for i, (low, high) in enumerate(ranges):
        first, last = max(low, tf.opacity[0][0]), min(high, tf.opacity[-1][0])
        opacity = _cut(tf.opacity, first, last) if first < last else ()
        if not any(alpha > 0 for _, alpha in opacity):
            raise ArgumentError(
                f"ranges[{i}]: expected a range with opacity above 0, got {row_text(ranges[i])}; "
                f"the transfer function is visible in {row_text(tf.support)}"
            )
        basic.append(TransferFunction(opacity, _cut(tf.color, low, high)))
    return basic


def combine(basic: Mapping[str, TransferFunction]) -> TransferFunction:
    """One transfer function that shows what the basic ones show together; `split` takes it apart again.

    Raises:
        ArgumentError: if two of them overlap, or there is none.
    """
    if not basic:
        raise ArgumentError("transfer functions: expected at least one, got none")
    check_disjoint(basic)
    opacity: list[tuple[float, ...]] = []
    color: list[tuple[float, ...]] = []
    end = 0.0  # of what the functions so far show
    for tf in sorted(basic.values(), key=lambda each: each.support):
        low, high = tf.support
        points = list(_cut(tf.opacity, low, high))
        if not opacity or opacity[-1][0] < low:  # transparent between two, also where one ends in a step
            points = [(low, 0.0), *points] if points[0][1] > 0 else points
            opacity += [(end, 0.0)] if opacity and opacity[-1][1] > 0 and end < low else []
        opacity += points
        end = just_above(high) if tf(high)[3] > 0 else high
        color += _cut(tf.color, low, high)
    return TransferFunction(tuple(opacity), tuple(color))  # type: ignore[arg-type]


def just_above(value: float) -> float:
    """The next number in single precision: a function whose opacity ends above 0 holds at its end.

    Next to 0 it is one whose difference has a finite inverse, which the caster multiplies with.
    """
    single, least = np.float32(value), np.finfo(np.float32).tiny
    return float(max(np.nextafter(single, np.float32(np.inf)), single + least))


def check_disjoint(basic: Mapping[str, TransferFunction]) -> None:
    """Require that no value is visible in two basic transfer functions; ranges may touch.

    Raises:
        ArgumentError: naming two that overlap, and where each is visible.
    """
    _check_no_overlap({name: tf.support for name, tf in basic.items()})


def _check_no_overlap(ranges: Mapping[str, tuple[float, float]]) -> None:
    for (name, one), (other, two) in combinations(ranges.items(), 2):
        if max(one[0], two[0]) < min(one[1], two[1]):
            raise ArgumentError(
                f"{name} and {other}: expected ranges of values that do not overlap, got {row_text(one)} and "
                f"{row_text(two)}; cut one of them"
            )


def _cut(points: Sequence[tuple[float, ...]], low: float, high: float) -> Any:
    """The points between two values, and the limits at them from inside."""
    inside = [point for point in points if low < point[0] < high]
    # Mirrored, the limit from the left becomes the one from the right.
    mirrored = [(-value, *rest) for value, *rest in reversed(points)]
    start, end = right_limit(points, np.array(low)), right_limit(mirrored, np.array(-high))
    return ((low, *start.tolist()), *inside, (high, *end.tolist()))
