"""Stream any source into the one canonical file that everything else reads."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from math import inf
from pathlib import Path
from typing import BinaryIO

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.core.io import write_atomic
from texgs.volume.blocks import block_count, block_means, block_middles
from texgs.volume.grid import Dims, Triple
from texgs.volume.nrrd_file import open_prepared, write_header
from texgs.volume.orientation import AxisPermutation, permuted_lattice, permuted_values, upright
from texgs.volume.slabs import Source, slab_bounds
from texgs.volume.summary import Summary, summarize

__all__ = ["Summary", "prepare"]

Bounds = tuple[tuple[int, int], tuple[int, int], tuple[int, int]]
Progress = Callable[[Iterable[tuple[int, int]], int], Iterable[tuple[int, int]]]
KEPT_TYPES = ("uint8", "int8", "uint16", "int16", "float32")
REDUCERS = {"mean": block_means, "sample": block_middles}


def prepare(
    source: Source,
    target: str | Path,
    *,
    crop: tuple[int, int, int, int, int, int] | None = None,
    reduce: int = 1,
    method: str = "mean",
    up: str = "+y",
    nan_value: float | None = None,
    progress: Progress | None = None,
) -> Summary:
    """Write the canonical file of a volume: a .nrrd with raw, little-endian samples that can be mapped.

    Samples stay uint8, int8, uint16, int16 or float32; bool becomes uint8, everything else float32. The
    volume is read slab by slab and never held as a whole.

    Args:
        source: the volume.
        target: file to write, .nrrd.
        crop: (x0, x1, y0, y1, z0, z1) in samples of the source, half open; default all.
        reduce: one sample for every block of reduce^3; incomplete blocks at the end count as they are.
        method: "mean" of a block (halves rounded to even for integers), or "sample", its middle, for
            labels. Either way the first sample is placed at the centre of the first block.
        up: axis of the source that becomes +y of the world; the new axes (x, y, z) are, in the old ones,
            +y: (x, y, z); -y: (x, -y, -z); +z: (x, z, -y); -z: (x, -z, y); +x: (-y, x, z); -x: (y, -x, z).
        nan_value: replaces NaN and infinity, before blocks are averaged.
        progress: called with the slabs and their number, yields the slabs again; for a progress bar.

    Returns:
        Lattice, range and histogram of what was written.

    Raises:
        ArgumentError: if an argument is out of range, samples are not finite or do not fit float32, the
            volume is constant, or fewer than two samples are left along an axis. Nothing is written then.
    """
    target = Path(target)
    if target.suffix != ".nrrd":
        raise ArgumentError(f"{target}: expected a target with the suffix .nrrd, got {target.suffix!r}")
    if method not in REDUCERS:
        raise ArgumentError(f"method: expected one of {', '.join(REDUCERS)}, got {method!r}")
    if nan_value is not None and not abs(nan_value) <= np.finfo(np.float32).max:
        raise ArgumentError(f"nan_value: expected a finite float32, got {nan_value}")
    bounds, axes = _bounds(source.dims, crop), upright(up)
    dims, spacing, origin = permuted_lattice(*_reduced_lattice(source, bounds, reduce), axes)
    dtype = _kept_type(source.dtype)
    tally = _Tally(source.name)

    def write(file: BinaryIO) -> None:
        offset = write_header(file, dims, dtype, spacing, origin)
        steps = slab_bounds(source, *bounds[2], multiple=reduce)
        for start, stop in steps if progress is None else progress(steps, len(steps)):
            block = tally.finite(_read(source, bounds, start, stop), bounds, start, nan_value)
            if reduce > 1:
                block = REDUCERS[method](block, reduce)
            block = tally.extend(_convert(block, dtype, source.name))
            _write_permuted(file, offset, dims, axes, block, (start - bounds[2][0]) // reduce)
        tally.check()

    write_atomic(target, write)
    return summarize(open_prepared(target), tally.minimum, tally.maximum)


class _Tally:
    """Range and bad samples of what streams past."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.minimum, self.maximum = inf, -inf
        self.n_bad = 0
        self.first: tuple[int, int, int] | None = None  # x, y, z of the first bad sample, in the source

    def finite(self, slab: np.ndarray, bounds: Bounds, start: int, nan_value: float | None) -> np.ndarray:
        """The slab with NaN and infinity replaced; counts them where no value was chosen."""
        if slab.dtype.kind != "f":
            return slab
        bad = ~np.isfinite(slab)
        if not bad.any():
            return slab
        if nan_value is None:
            self.n_bad += int(bad.sum())
            if self.first is None:
                z, y, x = (int(place) for place in np.unravel_index(bad.argmax(), bad.shape))
                self.first = x + bounds[0][0], y + bounds[1][0], z + start
        return np.where(bad, np.float32(nan_value or 0.0), slab)

    def extend(self, block: np.ndarray) -> np.ndarray:
        """Widen the range by a block, and return it."""
        self.minimum = min(self.minimum, float(block.min()))
        self.maximum = max(self.maximum, float(block.max()))
        return block

    def check(self) -> None:
        """Refuse a volume with bad samples, or with one value only."""
        if self.first is not None:
            raise ArgumentError(
                f"{self.name}: expected finite samples, got {self.n_bad} that are NaN or infinite, the first "
                f"at (x, y, z) = {self.first}; set nan_value to replace them"
            )
        if self.minimum == self.maximum:
            raise ArgumentError(
                f"{self.name}: expected a field that varies, but every sample is {self.minimum:g}; "
                "choose another volume or crop"
            )


def _bounds(dims: Dims, crop: tuple[int, ...] | None) -> Bounds:
    """First sample and sample after the last, per axis."""
    if crop is None:
        return (0, dims[0]), (0, dims[1]), (0, dims[2])
    if len(crop) != 6:
        raise ArgumentError(f"crop: expected six integers x0, x1, y0, y1, z0, z1, got {list(crop)}")
    for axis, low, high, size in zip("xyz", crop[::2], crop[1::2], dims, strict=True):
        if not 0 <= low < high <= size:
            raise ArgumentError(f"crop: expected 0 <= {axis}0 < {axis}1 <= {size}, got {low} and {high}")
    return (crop[0], crop[1]), (crop[2], crop[3]), (crop[4], crop[5])


def _reduced_lattice(source: Source, bounds: Bounds, reduce: int) -> tuple[Dims, Triple, Triple]:
    """Dims, spacing and origin after crop and reduction."""
    if reduce < 1:
        raise ArgumentError(f"reduce: expected an integer of at least 1, got {reduce}")
    nx, ny, nz = (block_count(high - low, reduce) for low, high in bounds)
    if min(nx, ny, nz) < 2:
        raise ArgumentError(
            f"{source.name}: expected at least 2 samples along every axis, but crop and reduce leave "
            f"{nx} x {ny} x {nz}; crop or reduce less"
        )
    dx, dy, dz = source.spacing
    x, y, z = (
        start + (low + 0.5 * (reduce - 1)) * step
        for start, (low, _), step in zip(source.origin, bounds, source.spacing, strict=True)
    )
    return (nx, ny, nz), (dx * reduce, dy * reduce, dz * reduce), (x, y, z)


def _kept_type(dtype: np.dtype) -> np.dtype:
    """Sample type in the canonical file, in the byte order of this machine."""
    if dtype.kind == "b":
        return np.dtype("uint8")
    return np.dtype(dtype.name if dtype.name in KEPT_TYPES else "float32")


def _read(source: Source, bounds: Bounds, start: int, stop: int) -> np.ndarray:
    """Slab [stop - start, Y, X] within the crop."""
    (x0, x1), (y0, y1), _ = bounds
    return source.slices(start, stop)[:, y0:y1, x0:x1]


def _convert(block: np.ndarray, dtype: np.dtype, name: str) -> np.ndarray:
    """The block as the type of the file."""
    if dtype.kind != "f":
        return (np.rint(block) if block.dtype.kind == "f" else block).astype(dtype, copy=False)
    with np.errstate(over="ignore"):
        converted = block.astype(dtype, copy=False)
    if not np.isfinite(converted).all():
        raise ArgumentError(
            f"{name}: expected samples that fit float32, got magnitudes up to {np.abs(block).max():g}; "
            "scale the field"
        )
    return converted


def _write_permuted(
    file: BinaryIO, offset: int, dims: Dims, axes: AxisPermutation, block: np.ndarray, start: int
) -> None:
    """Write slices of the source, from its slice `start` on, to where the permutation of axes puts them."""
    axis = next(axis for axis, (origin, _) in enumerate(axes) if origin == 2)  # y or z, never x
    place = start if axes[axis][1] > 0 else dims[axis] - start - len(block)
    z, y = (place, 0) if axis == 2 else (0, place)
    little = block.dtype.newbyteorder("<")
    for k, plane in enumerate(permuted_values(block, axes)):
        file.seek(offset + ((z + k) * dims[1] + y) * dims[0] * little.itemsize)
        file.write(np.ascontiguousarray(plane, dtype=little).data)
