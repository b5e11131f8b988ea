"""What there is to know about a prepared volume before it is rendered."""

from __future__ import annotations

from dataclasses import dataclass
from math import prod

import numpy as np

from texgs.volume.grid import Dims, Triple
from texgs.volume.slabs import Source, slab_bounds

BINS = 256


@dataclass(frozen=True)
class Summary:
    """Lattice, range and histogram of a volume; plain numbers, ready for JSON."""

    dims: Dims  # x, y, z
    dtype: str
    spacing: Triple
    origin: Triple
    minimum: float
    maximum: float
    histogram: tuple[int, ...]  # counts in 256 equal bins over [minimum, maximum]

    @property
    def voxels(self) -> int:
        """Number of samples."""
        return prod(self.dims)


def summarize(source: Source, minimum: float, maximum: float) -> Summary:
    """Summary of a volume whose range is known; reads it once.

    Args:
        source: any volume.
        minimum: smallest sample.
        maximum: largest sample, above `minimum`.
    """
    counts = np.zeros(BINS, dtype=np.int64)
    for start, stop in slab_bounds(source, 0, source.dims[2]):
        counts += histogram(source.slices(start, stop), minimum, maximum)
    histogram_counts = tuple(int(count) for count in counts)
    lattice = (source.dims, source.dtype.name, source.spacing, source.origin)
    return Summary(*lattice, minimum, maximum, histogram_counts)


def histogram(values: np.ndarray, minimum: float, maximum: float) -> np.ndarray:
    """Counts [256] in equal bins over [minimum, maximum]; the last bin includes its end."""
    if values.dtype.kind in "iu" and values.dtype.itemsize <= 2:
        # Counting every level first is ten times as fast.
        info = np.iinfo(values.dtype)
        counts = np.bincount(values.ravel().astype(np.intp) - info.min, minlength=info.max - info.min + 1)
        levels = np.arange(info.min, info.max + 1)
        return np.histogram(levels, BINS, (minimum, maximum), weights=counts)[0]
    # There may be fewer than 256 numbers of the samples' type in their range, but not in [0, 1].
    fractions = (values.astype(np.float64) - minimum) / (float(maximum) - float(minimum))
    return np.histogram(fractions, BINS, (0, 1))[0]
