"""A scalar field on a regular lattice: where it lies in the world, and its turns by right angles."""

from dataclasses import dataclass, replace
from math import isfinite, prod

import numpy as np

from texgs.core.errors import ArgumentError, ShapeError
from texgs.core.memory import require_memory
from texgs.volume.space import UNKNOWN_SPACE, Space, Triple

Dims = tuple[int, int, int]
ONES, ZEROS = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)

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


@dataclass(frozen=True, eq=False)
class Grid:
    """Samples of a scalar field on a regular lattice.

    Samples are points, as in VTK: n samples span (n - 1) * spacing.
    """

    values: np.ndarray  # [Z, Y, X], real numbers, every axis at least 2; x is the fastest axis, as in VTK
    spacing: Triple = ONES  # x, y, z; physical units, above 0
    origin: Triple = ZEROS  # centre of the first sample in the file's space; physical units
    others: tuple[np.ndarray, ...] = ()  # samples of further channels, of the same shape; masks are uint8
    space: Space = UNKNOWN_SPACE

    def __post_init__(self) -> None:
        check_lattice(dims_of(self.values.shape), self.values.dtype, self.spacing, self.origin)

    @property
    def dims(self) -> Dims:
        """Number of samples along x, y, z."""
        return dims_of(self.values.shape)

    def channel(self, number: int) -> "Grid":
        """Return the grid of one channel, by its number from 0."""
        channels = (self.values, *self.others)
        if number >= len(channels):
            raise ArgumentError(f"channel: expected one of 0 to {len(channels) - 1}, got {number}")
        return replace(self, values=channels[number], others=())

    @property
    def sides(self) -> list[float]:
        """Extent along x, y, z in physical units."""
        return [(size - 1) * step for size, step in zip(self.dims, self.spacing, strict=True)]

    @property
    def scale(self) -> float:
        """World units per physical unit: the longest side has length 1 in the world."""
        return 1.0 / max(self.sides)

    @property
    def world(self) -> Space:
        """The file's space, and the way there from the world."""
        middle = self.space.place(self.origin, [0.5 * side for side in self.sides])
        rows = np.column_stack([self.space.axes.T / self.scale, middle]).tolist()
        return replace(self.space, matrix=[*rows, [0.0, 0.0, 0.0, 1.0]])

    @property
    def aabb(self) -> tuple[Triple, Triple]:
        """Lowest and highest corner (x, y, z) in world units; the box is centred at the origin."""
        x, y, z = (0.5 * self.scale * side for side in self.sides)
        return (-x, -y, -z), (x, y, z)


def dims_of(shape: tuple[int, ...]) -> Dims:
    """Return the dims (x, y, z) of an array [Z, Y, X]."""
    if len(shape) != 3:
        components = f", {shape[-1]} components per sample?" if shape and shape[-1] in (2, 3, 4) else ""
        raise ShapeError(f"expected a scalar field [Z, Y, X], got the shape {list(shape)}{components}")
    z, y, x = (int(size) for size in shape)
    return x, y, z


def check_lattice(dims: Dims, dtype: np.dtype, spacing: Triple = ONES, origin: Triple = ZEROS) -> None:
    """Check what a lattice needs to be rendered: three axes with an extent, and real numbers."""
    if len(dims) != 3 or not all(size >= 2 for size in dims):
        raise ArgumentError(f"dims: expected at least 2 samples along x, y and z, got {list(dims)}")
    if dtype.kind not in "biuf":
        raise ArgumentError(f"dtype: expected integers, floats or bool, got {dtype}")
    if len(spacing) != 3 or not all(isfinite(step) and step > 0 for step in spacing):
        raise ArgumentError(
            f"spacing: expected three finite numbers above 0, got {list(spacing)}; set it right"
        )
    if len(origin) != 3 or not all(isfinite(place) for place in origin):
        raise ArgumentError(f"origin: expected three finite numbers (x, y, z), got {list(origin)}")


def byte_count(dims: Dims, dtype: np.dtype) -> int:
    """Return the size of the samples in bytes."""
    return prod(dims) * dtype.itemsize


def require_room(dims: Dims, dtype: np.dtype, beside: int = 0) -> None:
    """Require that samples that are read as a whole, and bytes beside them, fit into memory."""
    require_memory(
        byte_count(dims, dtype) + beside,
        f"{' x '.join(map(str, dims))} samples of {dtype.name}",
        "is the header damaged? Else store it as .nrrd, not compressed",
    )


def closest(directions: np.ndarray) -> AxisPermutation:
    """Find for each axis of space the stored axis that runs along it most nearly, and its sign.

    Directions [3, 3] are rows of unit length; where something is not finite, axes stay as they are stored.

    Raises:
        ArgumentError: if two axes run along one line, or all three in a plane.
    """
    from scipy.optimize import linear_sum_assignment

    if not np.isfinite(directions).all():
        return AS_STORED
    if abs(np.linalg.det(directions)) < 1e-3:
        raise ArgumentError(f"expected three independent axes, got a singular matrix: {directions.tolist()}")
    axes = linear_sum_assignment(np.abs(directions.T), maximize=True)[1].tolist()
    x, y, z = ((axis, 1 if directions[axis, along] >= 0 else -1) for along, axis in enumerate(axes))
    return x, y, z


def permuted_values(values: np.ndarray, axes: AxisPermutation) -> np.ndarray:
    """Return a view of an array [Z, Y, X] with other axes, again [Z, Y, X]."""
    flips = tuple(slice(None, None, sign) for _, sign in reversed(axes))
    return values.transpose([2 - axis for axis, _ in reversed(axes)])[flips]


def permuted_lattice(
    dims: Dims, spacing: Triple, origin: Triple, space: Space, axes: AxisPermutation
) -> tuple[Dims, Triple, Triple, Space]:
    """Return dims, spacing, origin and space of a lattice with other axes; no sample moves in its space."""
    # A flipped axis begins at its last sample.
    lengths = [(dims[axis] - 1) * spacing[axis] if (axis, -1) in axes else 0.0 for axis in range(3)]
    rows = np.array([sign * space.axes[axis] + 0.0 for axis, sign in axes])
    (i, _), (j, _), (k, _) = axes
    first, turned = space.place(origin, lengths), Space.along(rows, space.name, space.unit)
    return (dims[i], dims[j], dims[k]), (spacing[i], spacing[j], spacing[k]), first, turned
