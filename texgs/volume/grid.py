"""A scalar field on a regular lattice, and where the lattice lies in the world."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite, prod

import numpy as np

from texgs.core.errors import ArgumentError, ShapeError
from texgs.core.memory import require_memory

Triple = tuple[float, float, float]
Dims = tuple[int, int, int]


@dataclass(frozen=True, eq=False)
class Grid:
    """Samples of a scalar field on a regular lattice.

    Samples are points, as in VTK: n samples span (n - 1) * spacing.

    Raises:
        ShapeError, ArgumentError: if the values, the spacing or the origin are not as said below.
    """

    values: np.ndarray  # [Z, Y, X], real numbers, every axis at least 2; x is the fastest axis, as in VTK
    spacing: Triple = (1.0, 1.0, 1.0)  # x, y, z; physical units, above 0
    origin: Triple = (0.0, 0.0, 0.0)  # centre of the first sample, x, y, z; physical units

    def __post_init__(self) -> None:
        check_lattice(dims_of(self.values.shape), self.values.dtype, self.spacing, self.origin)

    @property
    def dims(self) -> Dims:
        """Number of samples along x, y, z."""
        return dims_of(self.values.shape)

    @property
    def scale(self) -> float:
        """World units per physical unit: the longest side has length 1 in the world."""
        return 1.0 / max(_sides(self.dims, self.spacing))

    @property
    def aabb(self) -> tuple[Triple, Triple]:
        """Lowest and highest corner (x, y, z) in world units; the box is centred at the origin."""
        x, y, z = (0.5 * self.scale * side for side in _sides(self.dims, self.spacing))
        return (-x, -y, -z), (x, y, z)


def dims_of(shape: tuple[int, ...]) -> Dims:
    """Dims (x, y, z) of an array [Z, Y, X]."""
    if len(shape) != 3:
        components = f", {shape[-1]} components per sample?" if shape and shape[-1] in (2, 3, 4) else ""
        raise ShapeError(f"expected a scalar field [Z, Y, X], got the shape {list(shape)}{components}")
    z, y, x = (int(size) for size in shape)
    return x, y, z


def check_lattice(dims: Dims, dtype: np.dtype, spacing: Triple, origin: Triple) -> None:
    """Check what a lattice needs to be rendered: three axes with an extent, and real numbers."""
    if len(dims) != 3 or not all(size >= 2 for size in dims):
        raise ArgumentError(f"dims: expected at least 2 samples along x, y and z, got {list(dims)}")
    if dtype.kind not in "biuf":
        raise ArgumentError(f"dtype: expected integers, floats or bool, got {dtype}")
    if len(spacing) != 3 or not all(isfinite(step) and step > 0 for step in spacing):
        raise ArgumentError(
            f"spacing: expected three finite numbers above 0 (x, y, z), got {list(spacing)}; "
            "set the right spacing"
        )
    if len(origin) != 3 or not all(isfinite(place) for place in origin):
        raise ArgumentError(f"origin: expected three finite numbers (x, y, z), got {list(origin)}")


def byte_count(dims: Dims, dtype: np.dtype) -> int:
    """Size of the samples in bytes."""
    return prod(dims) * dtype.itemsize


def require_room(dims: Dims, dtype: np.dtype, beside: int = 0) -> None:
    """Require that all samples fit into memory, for formats that are read as a whole.

    Args:
        dims: samples along x, y, z.
        dtype: of a sample.
        beside: bytes that reading takes besides.
    """
    what = f"{' x '.join(map(str, dims))} samples of {dtype.name}"
    require_memory(
        byte_count(dims, dtype) + beside,
        what,
        "is the header damaged? Else store it as .nrrd, not compressed",
    )


def _sides(dims: Dims, spacing: Triple) -> list[float]:
    """Extent along x, y, z in physical units."""
    return [(size - 1) * step for size, step in zip(dims, spacing, strict=True)]
