"""Text with a line per sample and a column per quantity, read slab by slab."""

from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.core.io import reading_as
from texgs.volume.grid import ONES, ZEROS, Dims, Triple
from texgs.volume.slabs import Source

KIND = "text with a line per sample and a number per column"


class ColumnSource(Source):
    """A column, counted from 1; x changes fastest from line to line. Slabs are best asked for in order."""

    def __init__(
        self,
        path: Path,
        spacing: Triple | None,
        origin: Triple | None,
        dims: Dims | None = None,
        column: int | None = None,
    ) -> None:
        if dims is None:
            raise ArgumentError("text has no header; set dims, and column where it has several")
        super().__init__(path.name, dims, np.dtype(np.float32), spacing or ONES, origin or ZEROS)
        with reading_as(KIND), _lines(path, nrows=1) as first:
            n_columns = first.get_chunk().shape[1]
        column = 1 if column is None and n_columns == 1 else column
        if column is None or column > n_columns:
            raise ArgumentError(
                f"dataset.volume.column: expected a number from 1 to {n_columns}, got {column or 'none'}"
            )
        self._path, self._options = path, {"usecols": [column - 1], "dtype": np.float32}
        self._reader, self._line = _lines(path, **self._options), 0  # the line that is read next

    def slices(self, start: int, stop: int) -> np.ndarray:
        """Return samples [stop - start, Y, X]; the file has to end with the last slice."""
        x, y, z = self.dims
        first, count = start * x * y, (stop - start) * x * y
        with reading_as(KIND, where=f"{self._path}: "):
            if self._line != first:
                self._reader.close()
                self._reader = _lines(self._path, skiprows=first, **self._options)
            try:
                values = self._reader.get_chunk(count + (stop == z)).to_numpy().ravel()
            except StopIteration:
                values = np.empty(0, np.float32)
        self._line = first + len(values)
        is_longer = not np.isnan(values[count:]).all()  # an empty line at the end is none
        if len(values) < count or is_longer:
            raise ArgumentError(
                f"{self._path}: expected {x} x {y} x {z} = {prod(self.dims)} lines, found "
                f"{'more' if is_longer else self._line}; correct dims, or get the file again"
            )
        return values[:count].reshape(stop - start, y, x)


def _lines(path: Path, **options: Any) -> Any:
    """Return pandas' reader of lines of numbers between blanks."""
    import pandas

    return pandas.read_csv(path, sep=r"\s+", header=None, skip_blank_lines=False, iterator=True, **options)
