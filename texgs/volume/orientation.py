"""Turn a lattice by right angles: so that its axes run along those of space, or a chosen axis points up."""

from __future__ import annotations

from itertools import permutations

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.volume.grid import Dims, Triple

# Where the new axes x, y, z come from: (axis before, sign).
AxisPermutation = tuple[tuple[int, int], tuple[int, int], tuple[int, int]]
AS_STORED: AxisPermutation = ((0, 1), (1, 1), (2, 1))
# By the axis of the volume that becomes +y: rotations, never a mirror.
UPRIGHT: dict[str, AxisPermutation] = {
    "+y": AS_STORED,  # (x, y, z)
    "-y": ((0, 1), (1, -1), (2, -1)),  # (x, -y, -z)
    "+z": ((0, 1), (2, 1), (1, -1)),  # (x, z, -y)
    "-z": ((0, 1), (2, -1), (1, 1)),  # (x, -z, y)
    "+x": ((1, -1), (0, 1), (2, 1)),  # (-y, x, z)
    "-x": ((1, 1), (0, -1), (2, 1)),  # (y, -x, z)
}


def upright(up: str) -> AxisPermutation:
    """Return the permutation that makes the volume's axis `up` the world's +y."""
    if up not in UPRIGHT:
        raise ArgumentError(f"up: expected one of {', '.join(UPRIGHT)}, got {up!r}")
    return UPRIGHT[up]


def closest(directions: np.ndarray) -> AxisPermutation:
    """For each axis of space find the stored axis that runs along it most nearly, and its sign.

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


def permuted_values(values: np.ndarray, axes: AxisPermutation) -> np.ndarray:
    """Return a view of an array [Z, Y, X] with other axes, again [Z, Y, X]."""
    flips = tuple(slice(None, None, sign) for _, sign in reversed(axes))
    return values.transpose([2 - axis for axis, _ in reversed(axes)])[flips]


def permuted_lattice(
    dims: Dims, spacing: Triple, origin: Triple, axes: AxisPermutation
) -> tuple[Dims, Triple, Triple]:
    """Return dims, spacing and origin after a rotation around the point (0, 0, 0) of physical space."""
    lattice = []
    for axis, sign in axes:
        last = origin[axis] + (dims[axis] - 1) * spacing[axis]
        # A flipped axis runs from the last sample to the first, and coordinates change sign.
        lattice.append((dims[axis], spacing[axis], origin[axis] if sign > 0 else 0.0 - last))
    (nx, dx, x), (ny, dy, y), (nz, dz, z) = lattice
    return (nx, ny, nz), (dx, dy, dz), (x, y, z)
