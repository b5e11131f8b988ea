"""Sources from files, and from objects of other libraries, known by their methods: none is imported."""

from collections.abc import Callable, Mapping, Sequence
from operator import index
from pathlib import Path
from typing import Any

import numpy as np

from texgs.api.display import as_python
from texgs.core.errors import ArgumentError, errors_at
from texgs.core.names import check_count
from texgs.volume.grid import ONES, ZEROS, Grid, Triple
from texgs.volume.layers import labelled_source
from texgs.volume.slabs import ArraySource, Source
from texgs.volume.sources import open_source
from texgs.volume.space import UNKNOWN_SPACE, Space

Numbers = Sequence[float] | None


def source_of(
    data: Any, layer: str | None, name: str, spacing: Numbers, origin: Numbers, keys: Mapping[str, Any]
) -> Source:
    """Return a file, an array [Z, Y, X], an ImageData of PyVista or a DataArray of xarray as a source.

    Args:
        data: of PyVista's arrays the active scalars count, else the first one of points, or else of cells.
            Those of xarray are read as files with labels are, see `texgs.volume.axes.axes_of`.
        layer: of a file with several: its channel.
        name: of data without a file, for messages.
        spacing: x, y, z, in place of the object's own.
        origin: the same.
        keys: of the format of a file.

    Raises:
        ArgumentError, ShapeError: if there is no scalar field on a regular lattice.
    """
    said = several("spacing", spacing, 3), several("origin", origin, 3)
    if isinstance(data, str | Path):
        keys = keys if layer is None else {**keys, "channel": layer}
        return open_source(data, spacing=said[0], origin=said[1], **keys_of_format(keys))
    if hasattr(data, "data_vars"):
        names = ", ".join(map(str, data.data_vars))
        raise ArgumentError(f"data: expected one array, got a Dataset of {names}; choose one by its name")
    if hasattr(data, "dims") and hasattr(data, "coords"):
        if len(data.dims) != 3:
            got = ", ".join(map(str, data.dims)) or "none"
            advice = "select one of each other, as by .isel(time=0)"
            raise ArgumentError(f"DataArray: expected three dimensions, got {got}; {advice}")
        with errors_at("DataArray"):
            return labelled_source("DataArray", data, said)
    if hasattr(data, "GetFieldData"):  # of VTK
        values, steps, first, space = of_image_data(data)
    else:
        values, steps, first, space = of_array(data), ONES, ZEROS, UNKNOWN_SPACE
    return ArraySource(Grid(values, said[0] or steps, said[1] or first, space=space), name)


def several(name: str, numbers: Any, count: int, kind: Callable[[Any], float] = float) -> Any:
    """Return a tuple of `count` numbers, whole ones where `kind` is `index`; None of None."""
    try:
        return None if numbers is None else tuple(map(kind, np.reshape(numbers, count).tolist()))
    except (TypeError, ValueError):
        what = f"{count} {'whole ' if kind is index else ''}numbers"
        raise ArgumentError(f"{name}: expected {what}, got {numbers!r:.100}") from None


def keys_of_format(keys: Mapping[str, Any]) -> dict[str, Any]:
    """Return options of formats with the types that readers expect."""
    plain = {key: as_python(value) for key, value in keys.items()}
    if "dims" in plain:
        plain["dims"] = several("dims", plain["dims"], 3, index)
    if isinstance(plain.get("series"), int):
        plain["series"] = str(plain["series"])  # DICOM has text
    for key, least in (("column", 1), ("skip", 0), ("time", 0)):
        if plain.get(key) is not None:
            check_count(key, plain[key], least)
    return plain


def of_array(data: Any) -> np.ndarray:
    """Return the samples of an array-like object, NaN where they are masked."""
    if np.ma.isMaskedArray(data) and np.ma.is_masked(data):
        return np.ma.filled(data.astype(np.result_type(data.dtype, np.float32)), np.nan)
    try:
        return np.asarray(data)
    except ValueError as error:
        kind = type(data).__name__
        raise ArgumentError(f"data: expected an array [Z, Y, X], got {kind} ({error})") from error


def of_image_data(image: Any) -> tuple[np.ndarray, Triple, Triple, Space]:
    """Return samples [Z, Y, X], spacing, origin and axes of image data or an even grid of PyVista or VTK."""
    from pyvista import wrap

    from texgs.volume.vtk_image import field_of

    lattice, values = field_of(wrap(image))
    directions = np.array(lattice["directions"])
    if np.linalg.det(directions) <= 0:
        raise ArgumentError("ImageData: expected axes that are not mirrored; write a .vti file and open that")
    (dx, dy, dz), (x, y, z) = lattice["spacing"], lattice["origin"]
    return values, (dx, dy, dz), (x, y, z), Space.along(directions)
