from collections import Counter
from fractions import Fraction

import numpy as np
import pytest

from texgs.volume.grid import Grid
from texgs.volume.slabs import ArraySource
from texgs.volume.summary import BINS, summarize

RNG = np.random.default_rng(0)
VALUES = {
    "uint8": RNG.integers(3, 200, (6, 5, 4)).astype(np.uint8),
    "int16": RNG.integers(-3000, 3000, (6, 5, 4)).astype(np.int16),
    "int32": RNG.integers(-(2**31), 2**31, (6, 5, 4)).astype(np.int32),
    "float32": RNG.normal(size=(6, 5, 4)).astype(np.float32),
    "ten steps of float32": (1e7 + RNG.integers(0, 10, (6, 5, 4))).astype(np.float32),
    "ten steps of float64": 1e16 + 2.0 * RNG.integers(0, 10, (6, 5, 4)),
    "smallest numbers": np.linspace(0, 3e-45, 120).reshape(6, 5, 4).astype(np.float32),
    "largest numbers": np.linspace(-3.4e38, 3.4e38, 120).reshape(6, 5, 4).astype(np.float32),
}


def counts(values):
    """Oracle: the bin of each sample in exact arithmetic."""
    numbers = [Fraction(value.item()) for value in values.ravel()]
    low, high = min(numbers), max(numbers)
    bins = Counter(min(int((number - low) * BINS / (high - low)), BINS - 1) for number in numbers)
    return tuple(bins[index] for index in range(BINS))


@pytest.mark.parametrize("values", VALUES.values(), ids=VALUES.keys())
def test_lattice_range_and_histogram(values):
    source = ArraySource(Grid(values, (1.0, 2.0, 3.0), (-1.0, 0.0, 1.0)))
    summary = summarize(source, float(values.min()), float(values.max()))
    assert (summary.dims, summary.dtype, summary.voxels) == ((4, 5, 6), values.dtype.name, 120)
    assert (summary.spacing, summary.origin) == ((1.0, 2.0, 3.0), (-1.0, 0.0, 1.0))
    assert summary.histogram == counts(values)
