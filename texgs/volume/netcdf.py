"""A variable of a classic NetCDF file, by SciPy: VTK takes one that is cut off, and fills up with zeros."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.core.io import reading_as
from texgs.volume.grid import ONES, ZEROS, Triple, dims_of
from texgs.volume.slabs import Source

if TYPE_CHECKING:
    from scipy.io import netcdf_file

CLASSIC = (b"CDF\x01", b"CDF\x02")  # the latter with offsets of 64 bits
CODED = ("scale_factor", "add_offset", "_FillValue", "missing_value")  # attributes of samples to decode


def open_netcdf(
    path: Path, spacing: Triple | None, origin: Triple | None, variable: str | None = None
) -> Source:
    """Open a variable with three dimensions, the last of which is x; those of size 1 do not count.

    Missing samples become NaN. Samples are as far apart as the coordinates say where these share a unit.
    """
    from scipy.io import netcdf_file

    with path.open("rb") as start:
        if start.read(4) not in CLASSIC:
            raise ArgumentError(
                "expected a classic NetCDF file, got NetCDF-4 or another format; "
                "convert it: nccopy -k classic OLD.nc NEW.nc"
            )
    with reading_as("a NetCDF file"):
        file = netcdf_file(path, maskandscale=True)
        shapes = {
            name: {axis: n for axis, n in zip(each.dimensions, each.shape, strict=True) if n != 1}
            for name, each in file.variables.items()
        }
    fields = [name for name, shape in shapes.items() if len(shape) == 3]
    variable = variable or (fields[0] if len(fields) == 1 else "")
    if variable not in shapes:
        raise ArgumentError(
            f"expected a variable of the file, got {variable or 'none'}; choose one by "
            f"dataset.volume.variable=NAME, of {', '.join(fields) or 'none, as none has three dimensions'}"
        )
    if variable not in fields:
        axes = " x ".join(f"{axis} {n}" for axis, n in shapes[variable].items())
        raise ArgumentError(
            f"variable {variable}: expected three dimensions, got {axes or 'one number'}; "
            "choose another, or cut out one step: ncks -d time,0 OLD.nc NEW.nc"
        )
    even, first = (spacing, ZEROS) if spacing else _lattice(file, list(shapes[variable])[::-1])
    return VariableSource(path, file, variable, even, origin or first)


def _lattice(file: netcdf_file, axes: list[str]) -> tuple[Triple, Triple]:
    """Return spacing and origin of coordinates in one unit; without them, samples are 1 apart."""
    known = [file.variables[axis] for axis in axes if axis in file.variables]
    units = {getattr(each, "units", b"") for each in known}
    places = [each[:].astype(np.float64) for each in known]
    if len(places) < 3 or len(units) > 1:
        return ONES, ZEROS
    steps = [np.diff(place) for place in places]
    for axis, step in zip(axes, steps, strict=True):
        if not np.allclose(step, step.mean(), rtol=1e-3):
            raise ArgumentError(
                f"{axis}: expected even coordinates, got steps of {step.min():g} to {step.max():g}; "
                "resample it, or set spacing"
            )
    dx, dy, dz = (abs(float(step.mean())) for step in steps)
    x, y, z = (float(place.min()) for place in places)
    return (dx, dy, dz), (x, y, z)


class VariableSource(Source):
    """A variable that is mapped into memory."""

    def __init__(self, path: Path, file: netcdf_file, variable: str, spacing: Triple, origin: Triple) -> None:
        # Only the file is kept: SciPy warns where one of its variables outlives it.
        self._file, self._variable = file, variable
        self._shape = file.variables[variable].shape
        is_coded = any(hasattr(file.variables[variable], name) for name in CODED)
        dtype = np.dtype(np.float32) if is_coded else file.variables[variable].data.dtype
        super().__init__(path.name, dims_of(tuple(n for n in self._shape if n != 1)), dtype, spacing, origin)

    def slices(self, start: int, stop: int) -> np.ndarray:
        """Return samples [stop - start, Y, X], decoded, NaN where they are missing."""
        index: list[slice | int] = [0 if n == 1 else slice(None) for n in self._shape]
        index[index.index(slice(None))] = slice(start, stop)
        samples = self._file.variables[self._variable][tuple(index)].astype(self.dtype)
        return np.ma.filled(samples, np.nan) if np.ma.isMaskedArray(samples) else samples
