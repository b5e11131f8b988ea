"""Turn a lattice so that a chosen axis points up in the world: rotations by right angles, never a mirror."""

from __future__ import annotations

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.volume.grid import Dims, Triple

Turn = tuple[tuple[int, int], tuple[int, int], tuple[int, int]]

# Axis of the volume that becomes +y: where the world's x, y, z come from, as (axis of the volume, sign).
TURNS: dict[str, Turn] = {
    "+y": ((0, 1), (1, 1), (2, 1)),  # (x, y, z)
    "-y": ((0, 1), (1, -1), (2, -1)),  # (x, -y, -z)
    "+z": ((0, 1), (2, 1), (1, -1)),  # (x, z, -y)
    "-z": ((0, 1), (2, -1), (1, 1)),  # (x, -z, y)
    "+x": ((1, -1), (0, 1), (2, 1)),  # (-y, x, z)
    "-x": ((1, 1), (0, -1), (2, 1)),  # (y, -x, z)
}


def turn_for(up: str) -> Turn:
    """The turn that makes the volume's axis `up` the world's +y.

    Raises:
        ArgumentError: if `up` is no axis.
    """
    if up not in TURNS:
        raise ArgumentError(f"up: expected one of {', '.join(TURNS)}, got {up!r}")
    return TURNS[up]


def turn_values(values: np.ndarray, turn: Turn) -> np.ndarray:
    """View of an array [Z, Y, X] with turned axes, again [Z, Y, X]."""
    axes = [2 - axis for axis, _ in reversed(turn)]
    flips = tuple(slice(None, None, sign) for _, sign in reversed(turn))
    return values.transpose(axes)[flips]


def turn_lattice(dims: Dims, spacing: Triple, origin: Triple, turn: Turn) -> tuple[Dims, Triple, Triple]:
    """Dims, spacing and origin after a turn around the point (0, 0, 0) of physical space."""
    turned = []
    for axis, sign in turn:
        last = origin[axis] + (dims[axis] - 1) * spacing[axis]
        # A flipped axis runs from the last sample to the first, and coordinates change sign.
        turned.append((dims[axis], spacing[axis], origin[axis] if sign > 0 else 0.0 - last))
    (nx, dx, x), (ny, dy, y), (nz, dz, z) = turned
    return (nx, ny, nz), (dx, dy, dz), (x, y, z)
