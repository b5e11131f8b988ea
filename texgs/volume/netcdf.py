"""Classic NetCDF, slab by slab, by SciPy: VTK takes a file that is cut off, and fills it up with zeros."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.core.io import reading_as
from texgs.volume.grid import ONES, ZEROS, Triple, dims_of
from texgs.volume.slabs import Source

CLASSIC = (b"CDF\x01", b"CDF\x02")  # the latter with offsets of 64 bits
CODED = ("scale_factor", "add_offset", "_FillValue", "missing_value")  # attributes of samples to decode


class VariableSource(Source):
    """A variable with three dimensions, of which the last is x and those of size 1 do not count."""

    def __init__(
        self, path: Path, spacing: Triple | None, origin: Triple | None, variable: str | None = None
    ) -> None:
        from scipy.io import netcdf_file

        if np.fromfile(path, np.uint8, 4).tobytes() not in CLASSIC:
            raise ArgumentError(
                "expected a classic NetCDF file, got NetCDF-4 or another format; "
                "convert it: nccopy -k classic OLD.nc NEW.nc"
            )
        with reading_as("a NetCDF file"):
            self._file = netcdf_file(path, maskandscale=True)
        shapes = {
            name: [(axis, n) for axis, n in zip(each.dimensions, each.shape, strict=True) if n != 1]
            for name, each in self._file.variables.items()
        }
        fields = [name for name, shape in shapes.items() if len(shape) == 3]
        self._variable = variable or (fields[0] if len(fields) == 1 else "")
        if self._variable not in fields:
            dimensions = " x ".join(f"{axis} {n}" for axis, n in shapes.get(self._variable, []))
            raise ArgumentError(
                "dataset.volume.variable: expected one with three dimensions, got "
                f"{dimensions or variable or 'none'}; choose one of {', '.join(fields) or 'another file'}, "
                "or cut out a step of time: ncks -d time,0 OLD.nc NEW.nc"
            )
        stored = self._file.variables[self._variable]  # not kept: SciPy warns of one that outlives its file
        dtype = np.dtype(np.float32) if any(hasattr(stored, name) for name in CODED) else stored.data.dtype
        dims = dims_of(tuple(n for _, n in shapes[self._variable]))
        super().__init__(path.name, dims, dtype, spacing or ONES, origin or ZEROS)

    def slices(self, start: int, stop: int) -> np.ndarray:
        """Return samples [stop - start, Y, X], NaN where they are missing."""
        variable = self._file.variables[self._variable]
        index: list[slice | int] = [0 if n == 1 else slice(None) for n in variable.shape]
        index[index.index(slice(None))] = slice(start, stop)
        samples = variable[tuple(index)].astype(self.dtype)
        return np.ma.filled(samples, np.nan) if np.ma.isMaskedArray(samples) else samples
