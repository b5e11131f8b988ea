"""Grids from objects of other libraries, which are known by what they can: none of these is imported."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.volume.grid import Grid, Triple

AXES = "zyx"
UNEVEN = 1e-3  # of a step: how far a coordinate of xarray may be from its place in a row of equal steps


def grid_of(data: Any, spacing: Sequence[float] | None, origin: Sequence[float] | None) -> Grid:
    """Return the grid of an array [Z, Y, X], an ImageData of PyVista or a DataArray of xarray.

    Args:
        data: PyVista's have point data, of which the active scalars count. Dimensions of xarray named x, y
            and z are put in their order, and their coordinates say where samples lie.
        spacing: x, y, z, in place of the object's own.
        origin: the same.

    Raises:
        ArgumentError, ShapeError: if there is no scalar field on a regular lattice.
    """
    if hasattr(data, "GetDirectionMatrix"):
        values, steps, first = of_image_data(data)
    elif hasattr(data, "dims") and hasattr(data, "coords"):
        values, steps, first = of_data_array(data)
    else:
        values, steps, first = np.asarray(data), (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)
    return Grid(values, three("spacing", spacing) or steps, three("origin", origin) or first)


def three(name: str, numbers: Sequence[float] | None) -> Triple | None:
    """Return three numbers as floats; None where there are none."""
    if numbers is None:
        return None
    if len(numbers) != 3:
        raise ArgumentError(f"{name}: expected three numbers x, y, z, got {list(numbers)}")
    x, y, z = map(float, numbers)
    return x, y, z


def of_image_data(image: Any) -> tuple[np.ndarray, Triple, Triple]:
    """Return samples [Z, Y, X], spacing and origin of PyVista's or VTK's image data."""
    from pyvista import wrap

    image = wrap(image)
    if not np.array_equal(np.reshape(image.direction_matrix, (3, 3)), np.eye(3)):
        raise ArgumentError(
            "ImageData: expected axes along x, y, z, got others; write it to a .vti file and open that, or "
            "resample it"
        )
    name = image.active_scalars_name or next(iter(image.point_data.keys()), None)
    if name not in image.point_data:
        raise ArgumentError(
            f"ImageData: expected scalars at points, got {len(image.cell_data)} arrays of cells; use "
            "image.cell_data_to_point_data()"
        )
    values = np.asarray(image.point_data[name])
    x, y, z = (int(size) for size in image.dimensions)
    return values.reshape(z, y, x, *values.shape[1:]), tuple(image.spacing), tuple(image.origin)


def of_data_array(array: Any) -> tuple[np.ndarray, Triple, Triple]:
    """Return samples [Z, Y, X], spacing and origin of xarray's data, with what its coordinates tell."""
    names = [str(name) for name in array.dims]
    if len(names) != 3:
        raise ArgumentError(
            f"DataArray: expected three dimensions, got {', '.join(names) or 'none'}; select one of each "
            "other, as by .isel(time=0)"
        )
    if {name.lower() for name in names} == set(AXES):
        array = array.transpose(*sorted(array.dims, key=lambda name: AXES.index(str(name).lower())))
    rows = [row_of(array, name) for name in reversed(array.dims)]
    (dx, x), (dy, y), (dz, z) = rows
    flips = tuple(slice(None, None, -1 if step < 0 else 1) for step, _ in reversed(rows))
    return np.asarray(array.values)[flips], (abs(dx), abs(dy), abs(dz)), (x, y, z)


def row_of(array: Any, name: Any) -> tuple[float, float]:
    """Return the step of a dimension's coordinate, below 0 where it falls, and its least value."""
    if name not in array.coords:
        return 1.0, 0.0
    places = np.asarray(array.coords[name].values)
    if places.dtype.kind not in "iuf" or len(places) < 2:
        return 1.0, 0.0
    places = places.astype(np.float64)
    steps = np.diff(places)
    step = float((places[-1] - places[0]) / (len(places) - 1))
    if not np.isfinite(step) or step == 0 or float(np.abs(steps - step).max()) > UNEVEN * abs(step):
        raise ArgumentError(
            f"DataArray: expected equal steps along {name}, got {steps.min():g} to {steps.max():g}; "
            f"interpolate it by .interp({name}=...)"
        )
    return step, float(places.min())
