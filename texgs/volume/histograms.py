"""Histograms of a volume: of all values, and one that neither hot pixels, padding nor decades decide."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from texgs.volume.slabs import Source, slab_bounds
from texgs.volume.suggest import looks_like_labels

Ends = tuple[float, float]

BINS = 256
FENCE = 0.5  # of the range of values that neighbours share: farther out, values are outliers ...
RARE = 1e-3  # ... where they are at most this of the samples outside the most frequent bin, ...
FEW = 8  # ... or this many
GAP = 1 / 8  # of the range, empty above the lowest bin, whose values are negative: these are padding
AIR = (-1100.0, -900.0)  # Hounsfield units: where a CT has these, padding is not its background
DECADES = 1e4  # largest value over the median, where classes are those of the logarithm


@dataclass(frozen=True)
class Histogram:
    """Counts in 256 equal bins over a range of values, or of their logarithms."""

    minimum: float
    maximum: float
    histogram: tuple[int, ...]
    scale: str = "linear"  # or "log"


def histogram(values: np.ndarray, minimum: float, maximum: float) -> np.ndarray:
    """Return counts [256] in equal bins over [minimum, maximum]; the last bin includes its end."""
    if values.dtype.kind in "iu" and values.dtype.itemsize <= 2:
        # Counting every level first is ten times as fast.
        info = np.iinfo(values.dtype)
        counts = np.bincount(values.ravel().astype(np.intp) - info.min, minlength=info.max - info.min + 1)
        levels = np.arange(info.min, info.max + 1)
        return np.histogram(levels, BINS, (minimum, maximum), weights=counts)[0]
    # There may be fewer than 256 numbers of the samples' type in their range, but not in [0, 1].
    fractions = (values.astype(np.float64) - minimum) / (float(maximum) - float(minimum))
    return np.histogram(fractions, BINS, (0, 1))[0]


def counted(source: Source, minimum: float, maximum: float, scale: str = "linear") -> Histogram:
    """Count the samples in a range, which is above 0 on a logarithmic scale; reads the volume once."""
    counts = np.zeros(BINS, dtype=np.int64)
    for slab in _slabs(source):
        if scale == "log":
            inside = np.log(slab[slab > 0].astype(np.float64))
            counts += histogram(inside, np.log(minimum), np.log(maximum))
        else:
            counts += histogram(slab, minimum, maximum)
    return Histogram(minimum, maximum, tuple(counts.tolist()), scale)


def robust_histogram(source: Source, whole: Histogram, shared: Ends) -> tuple[Histogram | None, str]:
    """Return the histogram to suggest functions from, None where that is the whole one, and a note for users.

    What neighbours share is a range: a sample is far out of it only where none beside it is like it. Few of
    these are outliers, as hot pixels are. Padding is moved next to the rest, as constant background is; it
    is left out where the rest has air about it.
    """
    found, notes, margin = whole, [], FENCE * (shared[1] - shared[0])
    low, high = shared[0] - margin, shared[1] + margin
    if margin > 0 and (low > whole.minimum or high < whole.maximum):
        inner = _counted_within(source, low, high)
        n_inner = sum(inner.histogram)
        n_outer = sum(whole.histogram) - n_inner
        if n_outer <= max(FEW, RARE * (n_inner - max(inner.histogram))):
            found = inner
            notes.append(f"{n_outer} lone samples outside [{inner.minimum:g}, {inner.maximum:g}]")
    first, second = np.flatnonzero(found.histogram)[:2]
    if found.minimum < 0 and second - first > GAP * BINS:
        middle = found.minimum + (first + second + 1) / 2 / BINS * (found.maximum - found.minimum)
        rest = _counted_within(source, middle, found.maximum)
        if rest.minimum < rest.maximum:
            notes.append(f"{found.histogram[first]} samples of padding, {found.minimum:g}")
            found = _beside_padding(source, rest, found.histogram[first])
    if source.dtype.kind == "f" and 0 < found.minimum < found.maximum / DECADES:
        logs = counted(source, found.minimum, found.maximum, "log")
        span = np.log(found.maximum / found.minimum)
        median = np.searchsorted(np.cumsum(logs.histogram), sum(logs.histogram) / 2) / BINS
        found = logs if (1 - median) * span > np.log(DECADES) else found
    if found is whole or looks_like_labels(np.array(found.histogram), found.maximum - found.minimum):
        return None, ""
    return found, f"functions are suggested without {' and '.join(notes)}" if notes else ""


def _beside_padding(source: Source, rest: Histogram, n_padding: int) -> Histogram:
    """Return the histogram of a volume whose padding is just below the rest, or nowhere in a CT with air."""
    low = rest.minimum - GAP * (rest.maximum - rest.minimum)
    counts = np.array(counted(source, low, rest.maximum).histogram)
    mode = low + (counts.argmax() + 0.5) / BINS * (rest.maximum - low)
    counts[0] = 0 if AIR[0] < mode < AIR[1] else n_padding
    return Histogram(low, rest.maximum, tuple(counts.tolist()))


def _counted_within(source: Source, low: float, high: float) -> Histogram:
    """Count the samples within bounds, over the range that they have."""
    inside = (slab[(slab >= low) & (slab <= high)] for slab in _slabs(source))
    ends = [(float(part.min()), float(part.max())) for part in inside if part.size]
    return counted(source, min(ends)[0], max(high for _, high in ends))


def _slabs(source: Source) -> Iterator[np.ndarray]:
    """Yield all samples, slab by slab."""
    for start, stop in slab_bounds(source, 0, source.dims[2]):
        yield source.slices(start, stop)
