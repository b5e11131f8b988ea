"""Sources whose axes run along those of physical space: permuted and flipped as their file says."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations

import numpy as np

from texgs.volume.grid import Grid, Triple
from texgs.volume.orientation import Turn, turn_values
from texgs.volume.slabs import ArraySource, RawSource

AS_STORED = ((0, 1), (1, 1), (2, 1))
ONES, ZEROS = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)


def oriented(
    source: ArraySource | RawSource,
    directions: np.ndarray,
    spacing: Triple | None,
    origin: Triple | None,
    *,
    is_left_handed: bool = False,
) -> ArraySource | RawSource:
    """A source with its axes along the closest ones of physical space, so that nothing is mirrored.

    Samples are mapped where they have to be turned and are not in memory.

    Args:
        source: as it is stored, with the spacing of its axes and the place of its first sample, unless these
            are replaced.
        directions: [3, 3], in its rows the directions of the axes as they are stored, of any length.
        spacing: replaces that of the result.
        origin: replaces that of the result.
        is_left_handed: of the physical space, whose first axis is then turned round.
    """
    steps, place = np.array(directions, dtype=np.float64), np.array(source.origin)
    if is_left_handed:
        steps[:, 0] *= -1
        place[0] *= -1
    turn = closest(steps / np.linalg.norm(steps, axis=1, keepdims=True))
    dx, dy, dz = spacing or (source.spacing[axis] for axis, _ in turn)
    lengths = [(source.dims[axis] - 1) * step for (axis, _), step in zip(turn, (dx, dy, dz), strict=True)]
    x, y, z = origin or (
        float(at) - (0.0 if sign > 0 else length)
        for at, (_, sign), length in zip(place, turn, lengths, strict=True)
    )
    if isinstance(source, RawSource) and turn == AS_STORED:
        return replace(source, spacing=(dx, dy, dz), origin=(x, y, z))
    if isinstance(source, RawSource):
        values: np.ndarray = np.memmap(source.path, source.stored, "r", source.offset, source.dims[::-1])
    else:
        values = source.grid.values
    return ArraySource(Grid(turn_values(values, turn), (dx, dy, dz), (x, y, z)), source.name)


def closest(directions: np.ndarray) -> Turn:
    """For each axis of space the stored axis that runs along it most nearly, and its sign.

    Args:
        directions: [3, 3], rows of unit length. Where something is not finite, axes stay as they are stored.
    """
    if not np.isfinite(directions).all():
        return AS_STORED
    x, y, z = max(
        permutations(range(3)),
        key=lambda axes: sum(abs(directions[axis, along]) for along, axis in enumerate(axes)),
    )
    signs = [1 if directions[axis, along] >= 0 else -1 for along, axis in enumerate((x, y, z))]
    return (x, signs[0]), (y, signs[1]), (z, signs[2])
