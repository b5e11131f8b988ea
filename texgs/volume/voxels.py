"""Points where a transfer function makes a volume visible."""

from __future__ import annotations

from math import ceil

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.volume.grid import Grid
from texgs.volume.transfer import TransferFunction

MOST = 64_000_000  # samples to look at: a larger volume is looked at with a stride


def visible_voxels(grid: Grid, tf: TransferFunction, count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Draw samples with a probability that grows with their opacity, each moved at random within its cell.

    One slice is in memory at a time (weighted reservoir sampling: Efraimidis and Spirakis 2006).

    Args:
        grid: the volume.
        tf: says which samples are visible.
        count: of points; fewer if fewer samples are visible.
        seed: of random numbers.

    Returns:
        Points [N, 3], world units, and their colours [N, 3] in [0, 1], float32.

    Raises:
        ArgumentError: if no sample is visible.
    """
    random = np.random.default_rng(seed)
    stride = ceil((grid.values.size / MOST) ** (1 / 3)) if grid.values.size > MOST else 1
    keys, places, colors = np.empty(0), np.empty((0, 3)), np.empty((0, 3))
    for z in range(0, grid.values.shape[0], stride):
        values = np.asarray(grid.values[z, ::stride, ::stride])
        rgba = tf(values)
        y, x = np.nonzero(rgba[..., 3] > 0)
        if not len(x):
            continue
        shown = rgba[y, x]
        own = np.log(random.random(len(x))) / shown[:, 3]  # the largest keys are the sample
        keys = np.concatenate([keys, own])
        places = np.concatenate([places, np.stack([x * stride, y * stride, np.full(len(x), z)], axis=1)])
        colors = np.concatenate([colors, shown[:, :3]])
        if len(keys) > count:
            best = np.argpartition(keys, -count)[-count:]
            keys, places, colors = keys[best], places[best], colors[best]
    if not len(keys):
        raise ArgumentError("volume: expected samples that the transfer function shows, found none")
    moved = places + stride * (random.random(places.shape) - 0.5)
    cell = grid.scale * np.array(grid.spacing)
    points = np.array(grid.aabb[0]) + cell * np.clip(moved, 0, np.array(grid.dims) - 1)
    return points.astype(np.float32), colors.astype(np.float32)
