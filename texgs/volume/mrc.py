"""MRC files and maps of cryo-EM, as sources."""

import warnings
from pathlib import Path
from typing import Any

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.core.io import reading_as
from texgs.volume.grid import (
    ONES,
    AxisPermutation,
    Grid,
    Triple,
    check_lattice,
    dims_of,
    permuted_values,
    require_room,
)
from texgs.volume.slabs import ArraySource, RawSource, Source
from texgs.volume.space import Space

MAP_SUFFIXES = (".mrc", ".map", ".ccp4", ".rec")  # suffixes
VERSIONS = (20140, 20141)  # versions of MRC with signed bytes
IMOD = 1146047817  # a word of headers by IMOD, with flags behind it


def open_mrc(path: Path, spacing: Triple | None, origin: Triple | None) -> Source:
    """Open a map whose columns, rows and sections may be along any axes; read on demand if uncompressed."""
    import mrcfile

    with reading_as("an MRC file"), warnings.catch_warnings(action="ignore"):
        with mrcfile.open(path, permissive=True, header_only=True) as file:
            header = file.header
        dims, dtype = (int(header.nx), int(header.ny), int(header.nz)), type_of(header)
        check_lattice(dims, dtype)
        if mrcfile.utils.spacegroup_is_volume_stack(header.ispg) and header.mz < header.nz:
            count = header.nz // header.mz
            raise ArgumentError(f"expected one volume, got a stack of {count}; take it apart")
        is_packed = path.suffix.lower() == ".gz"
        if is_packed:
            require_room(dims, dtype)
        with (mrcfile.open if is_packed else mrcfile.mmap)(path, permissive=True) as file:
            values = file.data
        if values is None:
            raise ArgumentError("the file is cut off or damaged: it has fewer samples than its header says")
        axes, steps, first, note = lattice_of(header)
        values = permuted_values(values.view(dtype).reshape(dims[::-1]), axes)
        lattice, space = (spacing or steps, origin or first), Space(unit="angstrom")
        if isinstance(values, np.memmap) and values.flags.c_contiguous:
            source: Source = RawSource(path, dims_of(values.shape), dtype, values.offset, *lattice, space)
        else:
            source = ArraySource(Grid(values, *lattice, space=space), path.name)
        source.note = "" if spacing else note
        return source


def type_of(header: Any) -> np.dtype:
    """Return the type of samples with its byte order; bytes are signed by version or IMOD's flags."""
    from mrcfile.utils import data_dtype_from_header

    dtype = data_dtype_from_header(header)
    word, flags = np.frombuffer(header.extra2.tobytes()[40:48], header.mode.dtype)
    has_sign = header.nversion in VERSIONS or (word == IMOD and flags & 1)
    return dtype if has_sign or dtype != np.int8 else np.dtype(np.uint8)


def lattice_of(header: Any) -> tuple[AxisPermutation, Triple, Triple, str]:
    """Return the permutation of axes x, y, z, spacing and origin along them, and notes."""
    stored = [int(header[name]) for name in ("mapc", "mapr", "maps")]
    if sorted(stored) != [1, 2, 3]:
        raise ArgumentError(f"expected columns, rows and sections along x, y, z, got axes {stored}")
    x, y, z = (stored.index(axis) for axis in (1, 2, 3))
    angles = [float(each) for each in header.cellb.item()]
    if not all(abs(angle - 90) < 0.01 or angle == 0 for angle in angles):
        raise ArgumentError(f"expected axes at right angles, got {angles}; resample the map")
    cell, intervals = header.cella.item(), [int(header[name]) for name in ("mx", "my", "mz")]
    is_told = min(cell) > 0 and min(intervals) > 0
    dx, dy, dz = (a / n for a, n in zip(cell, intervals, strict=True)) if is_told else ONES
    starts = [int(header[name]) for name in ("nxstart", "nystart", "nzstart")]
    first = header.origin.item()
    if not any(first):
        first = (starts[x] * dx, starts[y] * dy, starts[z] * dz)
    note = "MRC tells no spacing, so that samples are 1 apart; dataset.volume.spacing sets it"
    return ((x, 1), (y, 1), (z, 1)), (dx, dy, dz), first, "" if is_told else note
