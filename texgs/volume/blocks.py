"""Fewer samples: one per block of neighbours, their mean or the one in the middle."""

from __future__ import annotations

import numpy as np


def block_count(size: int, factor: int) -> int:
    """Blocks along an axis; the last may be incomplete."""
    return -(-size // factor)


def block_means(values: np.ndarray, factor: int) -> np.ndarray:
    """Mean of every block of factor^3 samples, float64; incomplete blocks average what there is.

    Args:
        values: [Z, Y, X] of any real type.
        factor: block edge in samples.
    """
    z, y, x = (np.arange(0, size, factor) for size in values.shape)
    # A row of blocks at a time: its sums stay in the cache, and there is no float copy of the whole.
    rows = [[values[k : k + factor, j : j + factor].sum(axis=(0, 1), dtype=np.float64) for j in y] for k in z]
    sums = np.add.reduceat(np.array(rows), x, axis=2)
    edges = (np.minimum(factor, size - first) for first, size in zip((z, y, x), values.shape, strict=True))
    return sums / np.einsum("i,j,k->ijk", *edges)


def block_middles(values: np.ndarray, factor: int) -> np.ndarray:
    """Sample in the middle of every block (the later of two), a copy; for labels, which have no mean."""
    middles = []
    for size in values.shape:
        starts = np.arange(0, size, factor)
        middles.append(starts + np.minimum(factor, size - starts) // 2)
    return values[np.ix_(*middles)]
