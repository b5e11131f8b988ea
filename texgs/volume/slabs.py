"""Volumes as sources, which hand out a slab of z slices at a time, so that any size fits into memory."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.volume.axes import Axis, Channel
from texgs.volume.grid import ONES, ZEROS, Dims, Grid, Triple, byte_count, check_lattice
from texgs.volume.space import UNKNOWN_SPACE, Space

SLAB_BYTES = 1 << 23  # reads of this size run at the disk's speed, and memory stays small


class Source(ABC):
    """A volume that can be read slab by slab; its lattice is as for `Grid`, its name for messages."""

    note = ""  # for the user, about choices and assumptions
    n_steps = 1  # time steps; this is one of them
    channels: Sequence[Channel] = ()  # channels of the file; this is one of them
    channel: Channel | None = None
    space = UNKNOWN_SPACE
    label: str | None = None  # of which this is the mask

    def __init__(self, name: str, dims: Dims, dtype: np.dtype, spacing: Triple, origin: Triple) -> None:
        check_lattice(dims, dtype, spacing, origin)
        self.name, self.dims, self.spacing, self.origin = name, dims, spacing, origin
        self.dtype = dtype.newbyteorder("=")  # that of this machine

    def take(self, axes: Sequence[Axis], index: Sequence[int | slice]) -> None:
        """Store the chosen step and channel of an index of axes, and their numbers."""
        for axis, place in zip(axes, index, strict=False):
            if isinstance(place, int) and axis.size > 1 and axis.kind == "time":
                self.n_steps, self.note = axis.size, step_note(place, axis.size)
            elif isinstance(place, int) and axis.kind == "channel":
                self.channels = axis.channels or (Channel(),) * axis.size
                self.channel = self.channels[place]

    @abstractmethod
    def slices(self, start: int, stop: int) -> np.ndarray:
        """Return samples [stop - start, Y, X] of the z slices start to stop - 1; 0 <= start < stop <= Z."""


class ArraySource(Source):
    """A grid in memory, or memory mapped; slices are views where the byte order is this machine's."""

    def __init__(self, grid: Grid, name: str = "volume") -> None:
        super().__init__(name, grid.dims, grid.values.dtype, grid.spacing, grid.origin)
        self._values, self.space = grid.values, grid.space

    def slices(self, start: int, stop: int) -> np.ndarray:
        """Return samples [stop - start, Y, X]."""
        return self._values[start:stop].astype(self.dtype, copy=False)


class RawSource(Source):
    """Uncompressed samples somewhere in a file; x is the fastest axis.

    It is read with plain reads, not mapped: the resident memory is that of the slabs in use. `stored` is the
    type of a sample with its byte order, `offset` the bytes before the first one.
    """

    def __init__(
        self,
        path: Path,
        dims: Dims,
        stored: np.dtype,
        offset: int = 0,
        spacing: Triple = ONES,
        origin: Triple = ZEROS,
        space: Space = UNKNOWN_SPACE,
    ) -> None:
        super().__init__(path.name, dims, stored, spacing, origin)
        self.space = space
        self._path, self._stored, self._offset = path, stored, offset
        size = path.stat().st_size
        if offset < 0 or size < offset + byte_count(dims, stored):
            expected = size_text(dims, stored, offset)
            raise ArgumentError(f"the file is cut off: expected {expected}, found {size} bytes")

    def slices(self, start: int, stop: int) -> np.ndarray:
        """Read samples [stop - start, Y, X] again at every call."""
        x, y, _ = self.dims
        offset = self._offset + start * x * y * self._stored.itemsize
        values = np.fromfile(self._path, self._stored, count=(stop - start) * x * y, offset=offset)
        if values.size < (stop - start) * x * y:
            raise ArgumentError(f"{self._path}: the file was cut off while it was read; read it again")
        return values.reshape(stop - start, y, x).astype(self.dtype, copy=False)

    def mapped(self) -> np.ndarray:
        """Return all samples [Z, Y, X] as they are stored, mapped into memory."""
        return np.memmap(self._path, self._stored, "r", self._offset, self.dims[::-1])


def size_text(dims: Dims, stored: np.dtype, skip: int) -> str:
    """Say how long a file of plain samples is."""
    skipped = f" + {skip} skipped" if skip else ""
    factors = " x ".join(map(str, [*dims, stored.itemsize]))
    return f"{factors} ({stored.name}){skipped} = {skip + byte_count(dims, stored)} bytes"


def step_note(time: int, n_steps: int) -> str:
    """Say which step of several was chosen."""
    return f"step {time} of {n_steps}; dataset.volume.time chooses another" if n_steps > 1 else ""


def slab_bounds(source: Source, start: int, stop: int, multiple: int = 1) -> list[tuple[int, int]]:
    """Cut the z slices start to stop - 1 into slabs [start, stop) of about `SLAB_BYTES`.

    Every slab but the last has a multiple of `multiple` slices.
    """
    x, y, _ = source.dims
    step = max(1, SLAB_BYTES // (x * y * source.dtype.itemsize * multiple)) * multiple
    return [(low, min(low + step, stop)) for low in range(start, stop, step)]
