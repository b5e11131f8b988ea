"""Text with a line per sample and a column per quantity, such as the contest's files of `ionization`."""

from __future__ import annotations

from math import prod
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.core.io import reading_as
from texgs.volume.grid import ONES, ZEROS, Dims, Triple
from texgs.volume.slabs import Source

if TYPE_CHECKING:
    from pandas.io.parsers import TextFileReader

KIND = "text with a line per sample and a number per column"


def open_text(
    path: Path,
    spacing: Triple | None,
    origin: Triple | None,
    dims: Dims | None = None,
    column: int | None = None,
) -> Source:
    """Open a column, counted from 1, of a text file, gzipped or not; x changes fastest from line to line."""
    if dims is None:
        raise ArgumentError("text has no header; set dims, and column where it has several")
    with reading_as(KIND), _lines(path, nrows=1) as first:
        n_columns = first.get_chunk().shape[1]
    if column is None and n_columns > 1:
        raise ArgumentError(
            f"expected one column, got {n_columns}; choose one by dataset.volume.column=NUMBER"
        )
    if not 1 <= (column or 1) <= n_columns:
        raise ArgumentError(f"column: expected 1 to {n_columns}, the columns of the file, got {column}")
    return ColumnSource(path, dims, column or 1, spacing or ONES, origin or ZEROS)


class ColumnSource(Source):
    """A column of a text file; it is read forwards, in the memory of a slab, so slabs are best in order."""

    def __init__(self, path: Path, dims: Dims, column: int, spacing: Triple, origin: Triple) -> None:
        super().__init__(path.name, dims, np.dtype(np.float32), spacing, origin)
        self._path, self._column = path, column
        self._reader: TextFileReader | None = None
        self._line = 0  # the next one that the reader returns

    def slices(self, start: int, stop: int) -> np.ndarray:
        """Return samples [stop - start, Y, X]; with the last slice, the file has to end."""
        x, y, z = self.dims
        with reading_as(KIND, where=f"{self._path}: "):
            if self._reader is None or self._line != start * x * y:
                self._open(start * x * y)
            values = self._next((stop - start) * x * y)
            is_longer = stop == z and np.isfinite(self._next(1)).any()
        if self._line < stop * x * y or is_longer:
            found = "more" if is_longer else f"{self._line}"
            raise ArgumentError(
                f"{self._path}: expected {x} x {y} x {z} = {prod(self.dims)} lines, found {found}; "
                "correct dims, or get the file again"
            )
        return values.reshape(stop - start, y, x)

    def _open(self, line: int) -> None:
        """Start to read at a line."""
        if self._reader is not None:
            self._reader.close()
        columns = {"usecols": [self._column - 1], "dtype": np.float32}
        self._reader, self._line = _lines(self._path, skiprows=line, **columns), line

    def _next(self, count: int) -> np.ndarray:
        """Return the numbers of the next lines; fewer where the file ends."""
        assert self._reader is not None
        try:
            values = self._reader.get_chunk(count).to_numpy().ravel()
        except StopIteration:
            values = np.empty(0, np.float32)
        self._line += len(values)
        return values


def _lines(path: Path, **options: object) -> TextFileReader:
    """Return a reader of lines of numbers between blanks."""
    import pandas

    fixed = {"sep": r"\s+", "header": None, "skip_blank_lines": False, "iterator": True}
    return pandas.read_csv(path, **fixed, **options)  # type: ignore[call-overload]
