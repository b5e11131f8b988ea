"""HDF5 and NetCDF, by h5py, and classic NetCDF, by SciPy: VTK fills up what is cut off with zeros."""

import posixpath
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.core.io import reading_as
from texgs.volume.axes import along, nameless
from texgs.volume.grid import Triple
from texgs.volume.layers import CODED, UNSIGNED, LayerSource, StoredArray, one_of

CLASSIC = (b"CDF\x01", b"CDF\x02")  # the latter with offsets of 64 bits
NO_COORDINATES = b"This is a netCDF dimension but not a netCDF variable"  # begins the NAME of such a scale


def open_netcdf(
    path: Path, spacing: Triple | None, origin: Triple | None, variable: str | None = None, **keys: Any
) -> LayerSource:
    """Open an array of a file in HDF5 or NetCDF by its path; further keys are those of `LayerSource`.

    Names and coordinates of axes are those of dimensions in NetCDF, and of dimension scales in HDF5.
    """
    start = np.fromfile(path, np.uint8, 4).tobytes()
    if start.startswith(b"CDF") and start not in CLASSIC:
        raise ArgumentError(
            "expected NetCDF-4 or classic NetCDF, got another one; convert it: nccopy -k nc4 OLD.nc NEW.nc"
        )
    with reading_as("an HDF5 or NetCDF file"):
        stored = _classic(path, variable) if start in CLASSIC else _hdf5(path, variable)
        return LayerSource(path, stored, (spacing, origin), **keys)


def _classic(path: Path, variable: str | None) -> StoredArray:
    """Find a variable of classic NetCDF, and keep no part of it: SciPy warns of what outlives its file."""
    from scipy.io import netcdf_file

    file = netcdf_file(path)
    like = {
        name: np.broadcast_to(each.data.dtype.type(), each.shape) for name, each in file.variables.items()
    }
    name = one_of(like, variable)
    field = file.variables[name]
    sizes = zip(field.dimensions, field.shape, strict=True)
    axes = [along(axis, n, file.variables.get(axis)) for axis, n in sizes]
    attributes = {key: getattr(field, key, "") for key in (*CODED, UNSIGNED)}
    dtype, chunks = field.data.dtype, [1] * len(axes)
    return StoredArray(lambda at: np.array(file.variables[name][at]), dtype, axes, chunks, attributes)


def _hdf5(path: Path, variable: str | None) -> StoredArray:
    """Find an array of HDF5."""
    import h5py

    with suppress(ImportError):
        import_module("hdf5plugin")  # registers more filters
    file, arrays = h5py.File(path, "r"), {}
    file.visititems(lambda name, item: arrays.update({name: item}) if _is_array(item) else None)
    array = arrays[one_of(arrays, variable)]
    stored = array.id.get_create_plist()
    if not all(h5py.h5z.filter_avail(stored.get_filter(k)[0]) for k in range(stored.get_nfilters())):
        raise ArgumentError("expected samples packed by gzip, got another filter; pip install hdf5plugin")
    axes = []
    for axis, n in zip(array.dims, array.shape, strict=True):
        scale = axis[0] if len(axis) else None
        name = axis.label or "?" if scale is None else posixpath.basename(scale.name)
        axes.append(along(name, n, scale if _is_array(scale) else None))
    axes = axes if {axis.name for axis in axes} - {"?"} else nameless(array.shape)
    return StoredArray(array.__getitem__, array.dtype, axes, array.chunks or [1] * array.ndim, array.attrs)


def _is_array(item: Any) -> bool:
    """Return whether an item of HDF5 is an array with samples, and not only the name of a dimension."""
    is_there = hasattr(item, "dtype") and bool(item.shape)
    return is_there and not bytes(item.attrs.get("NAME", b"")).startswith(NO_COORDINATES)
