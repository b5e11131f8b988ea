"""Suggest basic transfer functions for a volume from its histogram."""

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from numbers import Integral
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texgs.core.errors import ArgumentError
from texgs.volume.axes import Channel
from texgs.volume.transfer import TransferFunction

Array = NDArray[np.float64]
Class = tuple[int, int]  # bins [start, stop)

# Distinct for colour-blind people too (after Okabe and Ito 2008), softened for shaded surfaces.
COLORS = (
    (0.93, 0.77, 0.45),  # sand
    (0.36, 0.68, 0.90),  # sky
    (0.88, 0.42, 0.20),  # vermilion
    (0.12, 0.60, 0.46),  # green
    (0.78, 0.48, 0.70),  # mauve
    (0.20, 0.36, 0.70),  # blue
)
MAX_CLASSES = 5  # default number of classes, at most
SHELL_COUNT = 3  # classes of a histogram without peaks but the background
SINGLE_OPACITY = 0.3  # opacity of the only function
MAX_LABELS = 32  # a histogram with no more values than this holds labels
SMOOTHING_WIDTH = 0.02  # standard deviation, as a fraction of the range
FINE_WIDTH = 0.006  # the same beside the background, or half of the distance of bins that hold any
EMPTY_SHARE = 2e-4  # of the voxels outside the most frequent bin: a bin with fewer is empty ...
EMPTY_COUNT = 8.0  # ... and so is one with fewer voxels than this
VALLEY_DEPTH = 0.3  # a valley is this much (natural log of counts) below the peaks on both sides: 26 percent
TAIL_AREA = 0.03  # width (of the range) times share (of the foreground) that makes the tail of a peak a class
LOW_SHARE = 0.1  # share of the foreground's voxels that makes values below the background worth showing


def suggest(
    known: Mapping[str, Any], count: int | None = None, channel: Channel | None = None
) -> dict[str, TransferFunction]:
    """Propose basic transfer functions with disjoint supports: TF01, TF02, ... in ascending order of value.

    The background, the most frequent value and what is around it, is left out. What remains is cut at the
    valleys of the smoothed log histogram; where it has too few, as in simulations whose histogram only
    falls, at thresholds of least variance (Otsu 1979) on the log histogram. Where values are in at most 32
    of the bins, apart, they are taken for labels, the lowest for background. Higher values are more opaque.

    It is the histogram of a `Summary`, the robust one if there is, with two bins that are not empty. There
    are `count` functions, fewer where there are fewer values; by default what shows, at most 5. Of a channel
    with a window it is one by default, see `windowed`. Their numbers are short.
    """
    if count is not None and (not isinstance(count, Integral) or count < 1):
        raise ArgumentError(f"count: expected a whole number from 1 on, got {count!r}")
    known = known.get("robust") or known
    low, high = known["minimum"], known["maximum"]
    if count is None and channel and (shown := window_function(channel, low, high)):
        return {"TF01": shown.rounded(low, high)}
    to, back = (np.log, np.exp) if known.get("scale") == "log" else (float, float)
    minimum, maximum = float(to(low)), float(to(high))
    counts = np.asarray(known["histogram"], dtype=np.float64)
    values = minimum + (np.arange(len(counts)) + 0.5) * (maximum - minimum) / len(counts)
    present = counts > 0
    if looks_like_labels(counts, maximum - minimum):
        values, counts = values[present], counts[present]
        # Every value but the lowest is a class; too many are grouped with their neighbours.
        classes = _divide([(1, len(counts))], np.sqrt(counts), count or MAX_CLASSES)
    else:
        classes = _materials(counts, count)
    edges = np.concatenate([[minimum], (values[1:] + values[:-1]) / 2, [maximum]])
    opacities = np.geomspace(0.08, 0.6, len(classes)) if len(classes) > 1 else [SINGLE_OPACITY]
    basic = [
        _trapezoid(edges[start], edges[stop], opacities[i], i, (minimum, maximum), back).rounded(low, high)
        for i, (start, stop) in enumerate(classes)
    ]
    return {f"TF{i:02d}": tf for i, tf in enumerate(basic, start=1)}


def window_function(channel: Channel, low: float, high: float) -> TransferFunction | None:
    """Return a function in a channel's colour that rises over its window; None if it shows nothing."""
    if channel.window is None or channel.window[0] >= high:
        return None
    values = np.clip([*channel.window, high], low, high)
    opacity = np.interp(values, channel.window, (0, SINGLE_OPACITY))
    points = zip(values.tolist(), opacity.tolist(), strict=True)
    return TransferFunction(tuple(points), ((values.tolist()[0], *channel.color),))


def looks_like_labels(counts: Array, extent: float) -> bool:
    """Return whether values are taken for labels: few bins of their histogram hold any, most of them alone.

    Bins of noise have neighbours. Where a bin is one whole number wide, those of labels may have some, too.
    The extent is that of all bins, in units of the data.
    """
    present = counts > 0
    groups = int(present[0]) + int(np.count_nonzero(present[1:] & ~present[:-1]))
    is_step = 0.5 < extent / len(counts) <= 1
    return int(present.sum()) <= MAX_LABELS and (is_step or 2 * groups >= int(present.sum()))


def _materials(counts: Array, count: int | None) -> list[Class]:
    """Return the basins of the log histogram, without the background."""
    log = _smooth_log(counts)
    most, dip = count or MAX_CLASSES, VALLEY_DEPTH
    classes, tails = _classes(counts, log, dip)
    while len(classes) > most and _valleys(log, dip):
        dip *= 1.2
        classes, tails = _classes(counts, log, dip)
    classes = sorted(sorted(classes, key=lambda c: -counts[slice(*c)].sum())[:most])
    weights = log - log.min() + 1e-3  # positive: also an empty class can be divided
    if count is not None:
        return _divide(classes, weights, count)
    peaks, tails = [c for c in classes if c not in tails], [c for c in classes if c in tails]
    return sorted(peaks + _divide(tails, weights, max(SHELL_COUNT - len(peaks), len(tails))))


def _smooth_log(counts: Array) -> Array:
    """Return the logarithm of the counts after a Gaussian filter; a floor below the rare keeps noise flat.

    The filter is finer beside the background where a wide one would spread this over a peak, such as the
    lung's beside air.
    """
    from scipy.ndimage import gaussian_filter1d

    floor, mode = EMPTY_SHARE * (counts.sum() - counts.max()) + EMPTY_COUNT, _mode(counts)
    fine_width = max(FINE_WIDTH * len(counts), 0.5 * len(counts) / np.count_nonzero(counts))
    widths = SMOOTHING_WIDTH * len(counts), fine_width
    wide, fine = (np.log(gaussian_filter1d(counts, width) + floor) for width in widths)
    for log, finer in ((wide[mode:], fine[mode:]), (wide[mode::-1], fine[mode::-1])):
        end = [*_valleys(log, VALLEY_DEPTH), len(log)][0]
        if any(valley < _foot(log[:end]) for valley in _valleys(finer[:end], VALLEY_DEPTH)):
            log[:end] = finer[:end]
    return wide


def _mode(counts: Array) -> int:
    """Return the most frequent bin, but the last only if most voxels are there: objects may be saturated."""
    return int(counts.argmax() if counts[-1] > 0.5 * counts.sum() else counts[:-1].argmax())


def _classes(counts: Array, log: Array, dip: float) -> tuple[list[Class], list[Class]]:
    """Return the classes of the histogram, and those that are only a tail of the background."""
    mode = _mode(counts)
    basins = list(pairwise([0, *_valleys(log, dip), len(log)]))
    low, high = next(c for c in basins if c[0] <= mode < c[1])
    left, right = mode + 1 - _foot(log[low : mode + 1][::-1]), mode + _foot(log[mode:high])
    foreground = counts[:left].sum() + counts[right:].sum()
    lowest = 0 if counts[:left].sum() >= LOW_SHARE * foreground else right

    def is_broad(start: int, stop: int) -> bool:
        return counts[start:stop].sum() * (stop - start) >= TAIL_AREA * foreground * len(counts)

    classes: list[Class] = []
    for start, stop in basins:
        if lowest <= start != low:
            peak = start + int(log[start:stop].argmax())
            foot = peak + _foot(log[peak:stop])
            classes += [(start, foot), (foot, stop)] if is_broad(foot, stop) else [(start, stop)]
    tails = [c for c in ((low, left), (right, high)) if lowest <= c[0] < c[1]]
    tails = [c for c in tails if is_broad(*c)] or ([] if classes else tails)
    return sorted(classes + tails), tails


def _valleys(log: Array, dip: float) -> list[int]:
    """Return minima that lie at least `dip` below a maximum on either side."""
    valleys: list[int] = []
    best = 0  # the highest bin since the last valley, or the lowest since the last peak
    falling = False
    for i, height in enumerate(log):
        if falling:
            if height < log[best]:
                best = i
            elif height > log[best] + dip:
                valleys.append(best)
                best, falling = i, False
        elif height > log[best]:
            best = i
        elif height < log[best] - dip:
            best, falling = i, True
    return valleys


def _foot(log: Array) -> int:
    """Find the end of a peak that starts at bin 0: the point farthest below the line to its last bin.

    The triangle method (Zack et al. 1977). A peak that falls ever faster ends half way.
    """
    below = np.linspace(log[0], log[-1], len(log)) - log
    return int(below.argmax()) + 1 if below.max() > 1e-9 else max(len(log) // 2, 1)


def _divide(classes: Sequence[Class], weights: Array, count: int) -> list[Class]:
    """Split the class of the largest variance at Otsu's threshold until there are `count`."""
    classes = list(classes)
    while len(classes) < count and any(stop - start > 1 for start, stop in classes):
        start, stop = classes.pop(int(np.argmax([_variance(weights[slice(*c)]) for c in classes])))
        mass = np.cumsum(weights[start:stop])
        moment = np.cumsum(weights[start:stop] * np.arange(stop - start))
        left, right = mass[:-1], mass[-1] - mass[:-1]
        between = moment[:-1] ** 2 / left + (moment[-1] - moment[:-1]) ** 2 / right
        cut = start + 1 + int(between.argmax())
        classes += [(start, cut), (cut, stop)]
    return sorted(classes)


def _variance(weights: Array) -> float:
    """Return the weighted sum of squared distances from the mean bin."""
    bins = np.arange(len(weights))
    return float(weights @ (bins - np.average(bins, weights=weights)) ** 2)


def _trapezoid(
    low: float, high: float, opacity: float, i: int, data: tuple[float, float], back: Callable[[float], float]
) -> TransferFunction:
    """Let opacity rise over a quarter of the range and fall over another, but not at the ends of the data."""
    ramp = (high - low) / 4
    rise = ((low, opacity),) if low <= data[0] else ((low, 0.0), (low + ramp, opacity))
    fall = ((high, opacity),) if high >= data[1] else ((high - ramp, opacity), (high, 0.0))
    points = tuple((float(back(value)), alpha) for value, alpha in (*rise, *fall))
    return TransferFunction(opacity=points, color=((points[0][0], *COLORS[i % len(COLORS)]),))
