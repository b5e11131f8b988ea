"""Stream any source into the one canonical file that everything else reads."""

from collections.abc import Callable, Iterable, Sequence
from math import inf, prod
from pathlib import Path
from shutil import disk_usage
from typing import Any, BinaryIO

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.core.io import write_atomic
from texgs.core.memory import GIB
from texgs.core.names import check_count, is_number
from texgs.volume.grid import UPRIGHT, AxisPermutation, Dims, Triple, permuted_lattice, permuted_values
from texgs.volume.label_masks import HALF
from texgs.volume.nrrd_file import NRRD_TYPES, open_prepared, write_header
from texgs.volume.slabs import Source, slab_bounds
from texgs.volume.space import Space
from texgs.volume.summaries import Summary, summarize

Bounds = tuple[tuple[int, int], tuple[int, int], tuple[int, int]]
FLOAT32_INTEGERS = 2**24  # float32 holds all integers up to here
Step = tuple[int, int, int]  # channel, and a slab: slices [start, stop)
Progress = Callable[[Iterable[Step], int], Iterable[Step]]


def prepare(source: Source, target: Path, **keys: Any) -> Summary:
    """Write the canonical file of a volume of one channel, see `prepare_channels`."""
    (summary,) = prepare_channels([source], target, **keys)
    return summary


def prepare_channels(
    sources: Sequence[Source],
    target: Path,
    *,
    crop: tuple[int, int, int, int, int, int] | None = None,
    reduce: int = 1,
    method: str = "mean",
    up: str = "+y",
    nan_value: float | None = None,
    progress: Progress | None = None,
) -> list[Summary]:
    """Write the canonical file of a volume: a .nrrd with raw, little-endian samples that can be mapped.

    Samples stay uint8, int8, uint16, int16 or float32; bool becomes uint8, everything else float32. The
    volume is read slab by slab and never held as a whole. Masks of labels beside an image follow its samples,
    where other programs do not look for them, a byte a sample.

    Args:
        sources: the channels of the volume, most often one, and masks behind those of an image.
        target: file to write, .nrrd.
        crop: (x0, x1, y0, y1, z0, z1) in samples of the source, half open; default all.
        reduce: one sample for every block of reduce^3; incomplete blocks at the end count as they are.
        method: "mean" of a block (halves rounded to even for integers), or "sample", its middle, for
            labels. Either way the first sample is placed at the centre of the first block.
        up: axis of the source that becomes +y of the world; the new axes (x, y, z) are, in the old ones,
            +y: (x, y, z); -y: (x, -y, -z); +z: (x, z, -y); -z: (x, -z, y); +x: (-y, x, z); -x: (y, -x, z).
        nan_value: replaces NaN and infinity, before blocks are averaged.
        progress: called with the slabs and their number, yields the slabs again; for a progress bar.

    Raises:
        ArgumentError: if an argument is out of range, samples are not finite or do not fit float32, a
            channel is constant or unlike the first in lattice or type, fewer than two samples are left along
            an axis, or there is too little space on the disk. Nothing is written then.
    """
    _check_keys(nan_value, reduce, method, up)
    source = _first_of(sources)
    tallies = [_Tally(each.name, each.label is not None) for each in sources]
    labels = [each.label for each in sources if each.label is not None]
    count = len(labels) % len(sources)  # of masks behind an image
    bounds, axes = bounds_of(source.dims, crop), UPRIGHT[up]
    dims, spacing, origin, space = permuted_lattice(*_reduced_lattice(source, bounds, reduce), axes)
    dtypes = [_kept(each.dtype) for each in sources]
    ((x0, x1), (y0, y1), (z0, z1)), sizes = bounds, [prod(dims) * dtype.itemsize for dtype in dtypes]

    def write(file: BinaryIO) -> None:
        _require_disk(source.name, target, sum(sizes))
        channels = len(sources) - count
        offset = write_header(file, dims, dtypes[0], spacing, origin, space, channels, count, labels)
        offsets = [offset, *(offset + np.cumsum(sizes)).tolist()]
        slabs = slab_bounds(source, z0, z1, multiple=reduce)
        steps = [(number, *slab) for number in range(len(sources)) for slab in slabs]
        for number, start, stop in steps if progress is None else progress(steps, len(steps)):
            slab = sources[number].slices(start, stop)[:, y0:y1, x0:x1]
            block = tallies[number].finite(slab, (x0, y0, start), nan_value)
            if reduce > 1:
                block = REDUCERS[method](block, reduce)
            block = tallies[number].extend(_convert(block, dtypes[number], source.name))
            _write_permuted(file, offsets[number], dims, axes, block, (start - z0) // reduce)
        for tally in tallies:
            tally.check()

    write_atomic(target, write)
    return _summaries(source, target, tallies)


def _summaries(source: Source, target: Path, tallies: Sequence["_Tally"]) -> list[Summary]:
    """Summarize the channels of a written file; the source's note says what users should know."""
    written = open_prepared(target)
    pairs = zip(written, tallies, strict=True)
    summaries = [summarize(each, t.minimum, t.maximum, (t.low, t.high)) for each, t in pairs]
    notes = [source.note, *(each.note for each in summaries)]
    largest = max(-tallies[0].minimum, tallies[0].maximum)
    if source.dtype.kind in "iu" and written[0].dtype.kind == "f" and largest > FLOAT32_INTEGERS:
        notes.append(f"whole numbers above {FLOAT32_INTEGERS} are rounded, so that labels may become equal")
    source.note = "; ".join(dict.fromkeys(filter(None, notes)))
    return summaries


def _first_of(sources: Sequence[Source]) -> Source:
    """Return the first of some channels, and require of the others that they are like it; masks are uint8."""
    lattices = {(each.dims, each.spacing) for each in sources}
    types = {each.dtype for each in sources if each.label is None}
    if max(len(lattices), len(types)) > 1:
        raise ArgumentError(f"{sources[0].name}: expected channels of one lattice and type; choose some")
    return sources[0]


def _kept(dtype: np.dtype) -> np.dtype:
    """Return the type that samples of a type have in the file."""
    kept = "uint8" if dtype.kind == "b" else dtype.name
    return np.dtype(kept if kept in NRRD_TYPES else "float32")


def _require_disk(name: str, target: Path, needed: int) -> None:
    """Refuse a file of more bytes than the disk has room for."""
    if needed > (free := disk_usage(target.parent).free):
        sizes = f"{needed / GIB:.3g} GiB of disk, but {free / GIB:.3g} GiB are free"
        raise ArgumentError(f"{name}: needs {sizes}; crop or reduce it")


class _Tally:
    """Range and bad samples of a stream."""

    def __init__(self, name: str, is_mask: bool) -> None:
        self.name, self.is_mask = name, is_mask
        self.minimum, self.maximum = inf, -inf
        self.low, self.high = inf, -inf  # of values that a sample shares with one beside it, along x or y
        self.varies, self.sample = False, None  # before samples become those of the file
        self.n_bad = 0
        self.first: tuple[int, ...] = ()  # x, y, z of the first bad sample, in the source

    def finite(self, slab: np.ndarray, start: tuple[int, int, int], nan_value: float | None) -> np.ndarray:
        """Return the slab with NaN and infinity replaced; count them where no value was chosen."""
        bad = ~np.isfinite(slab) if slab.dtype.kind == "f" else np.zeros(0, bool)
        if bad.any() and nan_value is None:
            self.n_bad += int(bad.sum())
            place = np.unravel_index(bad.argmax(), bad.shape)
            self.first = self.first or tuple(int(p) + s for p, s in zip(place[::-1], start, strict=True))
        if bad.any():
            slab = np.where(bad, np.float32(nan_value or 0.0), slab)
        self.sample = slab.flat[0] if self.sample is None else self.sample
        self.varies = self.varies or bool((slab != self.sample).any())
        return slab

    def extend(self, block: np.ndarray) -> np.ndarray:
        """Widen the range by a block, and return it."""
        self.minimum = min(self.minimum, float(block.min()))
        self.maximum = max(self.maximum, float(block.max()))
        for pair in ((block[:, 1:], block[:, :-1]), (block[:, :, 1:], block[:, :, :-1])):
            self.low = min(self.low, float(np.maximum(*pair).min()))
            self.high = max(self.high, float(np.minimum(*pair).max()))
        return block

    def check(self) -> None:
        """Refuse a volume with bad samples, or with one value only, and a mask without any inside."""
        if self.first:
            raise ArgumentError(
                f"{self.name}: expected finite samples, got {self.n_bad} that are NaN or infinite, the first "
                f"at (x, y, z) = {self.first}; set nan_value to replace them"
            )
        if self.is_mask and self.maximum < HALF:
            raise ArgumentError(
                f"{self.name}: expected some samples, got none in the crop, or too few for "
                "reduce; leave the label out, or reduce less"
            )
        if self.minimum == self.maximum and self.varies:
            raise ArgumentError(
                f"{self.name}: expected samples that differ as float32, got all near {self.minimum:g}; "
                "subtract an offset, or scale them"
            )
        if self.minimum == self.maximum:
            raise ArgumentError(
                f"{self.name}: expected a field that varies, but every sample is {self.minimum:g}; "
                "choose another volume or crop"
            )


def bounds_of(dims: Dims, crop: Sequence[int] | None) -> Bounds:
    """Return first sample and sample after the last, per axis."""
    if crop is None:
        return (0, dims[0]), (0, dims[1]), (0, dims[2])
    if len(crop) != 6:
        raise ArgumentError(f"crop: expected six integers x0, x1, y0, y1, z0, z1, got {list(crop)}")
    for axis, low, high, size in zip("xyz", crop[::2], crop[1::2], dims, strict=True):
        if not 0 <= low < high <= size:
            raise ArgumentError(f"crop: expected 0 <= {axis}0 < {axis}1 <= {size}, got {low} and {high}")
    return (crop[0], crop[1]), (crop[2], crop[3]), (crop[4], crop[5])


def _check_keys(nan_value: float | None, reduce: int, method: str, up: str) -> None:
    """Refuse values out of range."""
    if nan_value is not None and not (is_number(nan_value) and abs(nan_value) <= np.finfo(np.float32).max):
        raise ArgumentError(f"nan_value: expected a finite float32, got {nan_value}")
    check_count("reduce", reduce)
    if method not in [*REDUCERS]:  # a list, as others may have no hash
        raise ArgumentError(f"method: expected one of {', '.join(REDUCERS)}, got {method!r}")
    if up not in [*UPRIGHT]:
        raise ArgumentError(f"up: expected one of {', '.join(UPRIGHT)}, got {up}")


def _reduced_lattice(source: Source, bounds: Bounds, reduce: int) -> tuple[Dims, Triple, Triple, Space]:
    """Return dims, spacing, origin and space after crop and reduction."""
    nx, ny, nz = (-(-(high - low) // reduce) for low, high in bounds)
    if min(nx, ny, nz) < 2:
        raise ArgumentError(
            f"{source.name}: expected at least 2 samples along every axis, but crop and reduce leave "
            f"{nx} x {ny} x {nz}; crop or reduce less"
        )
    dx, dy, dz = source.spacing
    skipped = [(low + 0.5 * (reduce - 1)) * s for (low, _), s in zip(bounds, source.spacing, strict=True)]
    first = source.space.place(source.origin, skipped)
    return (nx, ny, nz), (dx * reduce, dy * reduce, dz * reduce), first, source.space


def block_means(values: np.ndarray, factor: int) -> np.ndarray:
    """Return means of blocks of factor^3 samples, float64; incomplete blocks average what there is."""
    z, y, x = (np.arange(0, size, factor) for size in values.shape)
    # A row of blocks at a time: its sums stay in the cache, and there is no float copy of the whole.
    rows = [[values[k : k + factor, j : j + factor].sum(axis=(0, 1), dtype=np.float64) for j in y] for k in z]
    sums = np.add.reduceat(np.array(rows), x, axis=2)
    edges = (np.minimum(factor, size - first) for first, size in zip((z, y, x), values.shape, strict=True))
    return sums / np.einsum("i,j,k->ijk", *edges)


def block_middles(values: np.ndarray, factor: int) -> np.ndarray:
    """Return the sample in the middle of every block (the later of two); for labels, which have no mean."""
    starts = [(np.arange(0, size, factor), size) for size in values.shape]
    return values[np.ix_(*(first + np.minimum(factor, size - first) // 2 for first, size in starts))]


REDUCERS = {"mean": block_means, "sample": block_middles}


def _convert(block: np.ndarray, dtype: np.dtype, name: str) -> np.ndarray:
    """Return the block as the type of the file."""
    if dtype.kind != "f":
        return (np.rint(block) if block.dtype.kind == "f" else block).astype(dtype, copy=False)
    with np.errstate(over="ignore"):
        converted = block.astype(dtype, copy=False)
    if not np.isfinite(converted).all():
        raise ArgumentError(
            f"{name}: expected samples that fit float32, got up to {np.abs(block).max():g}; scale them"
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
