"""Files of samples without a lattice: plain numbers, arrays of NumPy, and columns of text."""

from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.core.io import reading_as
from texgs.volume.grid import (
    ONES,
    ZEROS,
    Dims,
    Grid,
    Triple,
    byte_count,
    check_lattice,
    dims_of,
    require_room,
)
from texgs.volume.slabs import ArraySource, RawSource, Source, size_text

# Tried in this order where the size of a plain file does not fit the type given.
COMMON_TYPES = ("uint8", "uint16", "float32", "float64")


def open_raw(
    path: Path,
    spacing: Triple | None,
    origin: Triple | None,
    dims: Dims | None = None,
    dtype: str | None = None,
    endian: str = "little",
    skip: int = 0,
) -> RawSource:
    """Open plain samples; the file's size must fit exactly, the only check there is."""
    if dims is None or dtype is None:
        missing = " and ".join(key for key, value in (("dims", dims), ("dtype", dtype)) if value is None)
        raise ArgumentError(f"plain samples have no header; set {missing}, and endian and skip where needed")
    if endian not in ("little", "big"):
        raise ArgumentError(f"endian: expected little or big, got {endian!r}")
    try:
        stored = np.dtype(dtype).newbyteorder("<" if endian == "little" else ">")
    except (SyntaxError, TypeError) as error:
        raise ArgumentError(f"dtype: expected a name such as uint8 or float32, got {dtype!r}") from error
    check_lattice(dims, stored)
    size = path.stat().st_size
    if size != skip + byte_count(dims, stored):
        fits = [name for name in COMMON_TYPES if size == skip + byte_count(dims, np.dtype(name))]
        advice = f"dtype {fits[0]} would fit" if fits else "correct dims, dtype or skip"
        raise ArgumentError(f"expected {size_text(dims, stored, skip)}, found {size}; {advice}")
    return RawSource(path, dims, stored, skip, spacing or ONES, origin or ZEROS)


def open_npy(
    path: Path, spacing: Triple | None, origin: Triple | None, variable: str | None = None
) -> Source:
    """Open a NumPy array [Z, Y, X], or one of an archive."""
    with reading_as(f"a {path.suffix.lower()} file"):
        values = np.load(path, mmap_mode="r", allow_pickle=False)
        if isinstance(values, np.lib.npyio.NpzFile):
            with values as arrays:
                name = variable or (arrays.files[0] if len(arrays.files) == 1 else "none")
                if name not in arrays.files:
                    known = ", ".join(arrays.files)
                    raise ArgumentError(f"dataset.volume.variable: expected one of {known}, got {name}")
                values = arrays[name]
    lattice = (spacing or ONES, origin or ZEROS)
    if isinstance(values, np.memmap) and values.flags.c_contiguous:
        return RawSource(path, dims_of(values.shape), values.dtype, values.offset, *lattice)
    return ArraySource(Grid(values, *lattice), path.name)


def open_text(
    path: Path,
    spacing: Triple | None,
    origin: Triple | None,
    dims: Dims | None = None,
    column: int | None = None,
) -> ArraySource:
    """Open a column of text with a line per sample, counted from 1; x changes fastest from line to line."""
    import pandas

    if dims is None:
        raise ArgumentError("text has no header; set dims, and column where it has several")
    dtype, count = np.dtype(np.float32), prod(dims)
    check_lattice(dims, dtype)
    require_room(dims, dtype)
    options: dict[str, Any] = {"sep": r"\s+", "header": None, "skip_blank_lines": False}
    with reading_as("text with a line per sample and a number per column"):
        n_columns = pandas.read_csv(path, nrows=1, **options).shape[1]
        column = 1 if column is None and n_columns == 1 else column
        if column is None or column > n_columns:
            raise ArgumentError(
                f"dataset.volume.column: expected a number from 1 to {n_columns}, got {column or 'none'}"
            )
        table = pandas.read_csv(path, usecols=[column - 1], dtype=dtype, nrows=count + 1, **options)
    values = table.to_numpy().ravel()
    is_longer = not np.isnan(values[count:]).all()  # an empty last line is no sample
    if len(values) < count or is_longer:
        raise ArgumentError(
            f"expected {' x '.join(map(str, dims))} = {count} lines, found "
            f"{'more' if is_longer else len(values)}; correct dims, or get the file again"
        )
    grid = Grid(values[:count].reshape(dims[::-1]), spacing or ONES, origin or ZEROS)
    return ArraySource(grid, path.name)
