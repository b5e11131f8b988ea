"""Volumes that hand out a slab of z slices at a time, so that any size fits into memory."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.volume.grid import Dims, Grid, Triple, byte_count, check_lattice

SLAB_BYTES = 1 << 23  # reads of this size run at the disk's speed, and memory stays small


class Source(Protocol):
    """A volume that can be read slab by slab; lattice as for `Grid`."""

    @property
    def name(self) -> str:
        """What messages call it."""

    @property
    def dims(self) -> Dims:
        """Number of samples along x, y, z."""

    @property
    def dtype(self) -> np.dtype:
        """Type of a sample, in the byte order of this machine."""

    @property
    def spacing(self) -> Triple:
        """Distance of samples along x, y, z, physical units."""

    @property
    def origin(self) -> Triple:
        """Centre of the first sample, physical units."""

    def slices(self, start: int, stop: int) -> np.ndarray:
        """Samples [stop - start, Y, X] of the z slices start to stop - 1; 0 <= start < stop <= Z."""


@dataclass(frozen=True, eq=False)
class ArraySource:
    """A grid in memory, or memory mapped."""

    grid: Grid
    name: str = "volume"

    @property
    def dims(self) -> Dims:
        """Number of samples along x, y, z."""
        return self.grid.dims

    @property
    def dtype(self) -> np.dtype:
        """Type of a sample, in the byte order of this machine."""
        return self.grid.values.dtype.newbyteorder("=")

    @property
    def spacing(self) -> Triple:
        """Distance of samples along x, y, z, physical units."""
        return self.grid.spacing

    @property
    def origin(self) -> Triple:
        """Centre of the first sample, physical units."""
        return self.grid.origin

    def slices(self, start: int, stop: int) -> np.ndarray:
        """Samples [stop - start, Y, X]; a view where the byte order is this machine's."""
        return self.grid.values[start:stop].astype(self.dtype, copy=False)


@dataclass(frozen=True, eq=False)
class RawSource:
    """Samples as they are in memory, somewhere in a file; x is the fastest axis.

    It is read with plain reads, not mapped: the resident memory is that of the slabs in use.

    Raises:
        ArgumentError: if the lattice is not as `Grid` needs it, or the file is too short for it.
    """

    path: Path
    dims: Dims
    stored: np.dtype  # with byte order
    offset: int = 0  # bytes before the first sample
    spacing: Triple = (1.0, 1.0, 1.0)
    origin: Triple = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        check_lattice(self.dims, self.stored, self.spacing, self.origin)
        if not self.path.is_file():
            raise ArgumentError(f"no such file with samples: {self.path}")
        size = self.path.stat().st_size
        if self.offset < 0 or size < self.offset + byte_count(self.dims, self.stored):
            raise ArgumentError(f"the file is cut off: {self.expected_size()}, found {size} bytes")

    @property
    def name(self) -> str:
        """File name."""
        return self.path.name

    @property
    def dtype(self) -> np.dtype:
        """Type of a sample, in the byte order of this machine."""
        return self.stored.newbyteorder("=")

    def slices(self, start: int, stop: int) -> np.ndarray:
        """Samples [stop - start, Y, X], read anew at every call."""
        x, y, _ = self.dims
        offset = self.offset + start * x * y * self.stored.itemsize
        values = np.fromfile(self.path, self.stored, count=(stop - start) * x * y, offset=offset)
        if values.size < (stop - start) * x * y:
            raise ArgumentError(f"{self.path}: the file was cut off while it was read; read it again")
        return values.reshape(stop - start, y, x).astype(self.dtype, copy=False)

    def expected_size(self) -> str:
        """How long the file must be, in words."""
        x, y, z = self.dims
        total = self.offset + byte_count(self.dims, self.stored)
        skip = f" + {self.offset} skipped" if self.offset else ""
        return f"expected {x} x {y} x {z} x {self.stored.itemsize} ({self.dtype}){skip} = {total} bytes"


def slab_bounds(source: Source, start: int, stop: int, multiple: int = 1) -> list[tuple[int, int]]:
    """Cut the z slices start to stop - 1 into slabs of about `SLAB_BYTES`.

    Args:
        source: the volume.
        start: first slice.
        stop: slice after the last.
        multiple: slices of every slab but the last are a multiple of it.

    Returns:
        First slice and slice after the last of every slab.
    """
    x, y, _ = source.dims
    step = max(1, SLAB_BYTES // (x * y * source.dtype.itemsize * multiple)) * multiple
    return [(low, min(low + step, stop)) for low in range(start, stop, step)]
