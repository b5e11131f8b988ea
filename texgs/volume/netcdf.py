"""HDF5 and NetCDF-4, by h5py, and classic NetCDF, by xarray: VTK fills up what is cut off with zeros."""

import posixpath
from contextlib import nullcontext, suppress
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.core.io import reading_as
from texgs.volume.axes import Axis, attributes_of, axes_of, nameless
from texgs.volume.grid import Triple
from texgs.volume.layers import LayerSource, gaps_in, labelled_source, one_of

CLASSIC = (b"CDF\x01", b"CDF\x02")  # the latter with offsets of 64 bits
NO_COORDINATES = b"This is a netCDF dimension but not a netCDF variable"  # start of the NAME of a scale
# NetCDF fills what was never written with these codes, unless the file names another; bytes have no code.
INTEGERS = {"i2": -32767, "u2": 2**16 - 1, "i4": 1 - 2**31, "u4": 2**32 - 1, "i8": 2 - 2**63, "u8": 2**64 - 2}
CODES = INTEGERS | dict.fromkeys(("f4", "f8"), 9.969209968386869e36)
NEVER_WRITTEN: dict[str, dict[str, Any]] = {dtype: {"_FillValue": code} for dtype, code in CODES.items()}


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
        return (_classic if start in CLASSIC else _hdf5)(path, variable, (spacing, origin), **keys)


def _classic(path: Path, variable: str | None, given: Any, **keys: Any) -> LayerSource:
    """Open a variable of classic NetCDF."""
    import xarray

    file = xarray.open_dataset(path, engine="scipy", decode_cf=False, cache=False)
    field = file[one_of({str(name): file[name] for name in file.variables}, variable)]
    code = NEVER_WRITTEN.get(field.dtype.str[1:], {})
    return labelled_source(path, field.assign_attrs(code | field.attrs), given, **keys)


def _hdf5(path: Path, variable: str | None, given: Any, **keys: Any) -> LayerSource:
    """Open an array of HDF5."""
    import h5py

    with suppress(ImportError):
        import_module("hdf5plugin")  # registers more filters
    try:
        file = h5py.File(path, "r")
    except BlockingIOError as error:
        raise ArgumentError(
            "expected a file that no program writes to, got one that is locked; close it there, or set "
            "HDF5_USE_FILE_LOCKING=FALSE"
        ) from error
    arrays, broken = arrays_in(file)
    asked = (variable or "").strip("/")
    for name in [name for name in broken if name == asked or not arrays]:
        raise ArgumentError(f"{name} {broken[name]}; put it there")
    if asked and _is_array(file.get(asked)):  # a path may be that of a link
        arrays[asked] = file[asked]
    array = arrays[one_of(arrays, variable)]
    require_filters(array)
    if array.is_virtual:
        require_sources(array)
    chunks, attributes, gaps = array.chunks, attributes_of(array), ""
    if "_NCProperties" in file.attrs:
        attributes = NEVER_WRITTEN.get(array.dtype.str[1:], {}) | attributes
    if chunks and not array.is_virtual:
        gaps = gaps_in(array, chunks, array.id.get_num_chunks(), array.fillvalue)
    note = "; ".join(filter(None, (gaps, *(f"{name} {what}" for name, what in broken.items()))))
    return LayerSource(path, array, labels_of(array), attributes, given, chunks=chunks, note=note, **keys)


def labels_of(array: Any) -> list[Axis]:
    """Return the axes of an array by their labels, and by the scales of dimensions with coordinates."""
    scales = [axis[0] if len(axis) else None for axis in array.dims]
    labels = [axis.label or f"?{k}" for k, axis in enumerate(array.dims)]
    names = [posixpath.basename(x.name) if x else label for x, label in zip(scales, labels, strict=True)]
    if len({*names}) < len(names) or all(name.startswith("?") for name in names):
        return axes_of(nameless(array.shape), array.shape, {})
    return axes_of(names, array.shape, {k: x for k, x in zip(names, scales, strict=True) if _is_array(x)})


def arrays_in(file: Any) -> tuple[dict[str, Any], dict[str, str]]:
    """Return arrays by their paths, also those behind links; and what is missing, by the paths of links."""
    import h5py

    links: dict[str, Any] = {}
    names: dict[Any, str] = {}  # one name for each item
    broken: dict[str, str] = {}
    file.visititems(lambda name, item: names.update({item: name}))
    file.visititems_links(lambda name, link: links.update({name: link}))
    for name, link in links.items():
        item = file.get(name)
        if item is None:
            broken[name] = f"links to {getattr(link, 'filename', link.path)}, which is not there"
        elif item not in names:
            names[item] = name
            if isinstance(item, h5py.Group):
                item.visititems(lambda below, each, name=name: names.update({each: f"{name}/{below}"}))
    return {name: item for item, name in names.items() if _is_array(item)}, broken


def require_filters(array: Any) -> None:
    """Require the filters that unpack the chunks of an array."""
    import h5py

    stored = array.id.get_create_plist()
    codes = [stored.get_filter(k)[0] for k in range(stored.get_nfilters())]
    stored.close()  # HDF5 crashes at the end of a process where it has to close that of a virtual array
    if not all(map(h5py.h5z.filter_avail, codes)):
        raise ArgumentError("expected samples packed by gzip, got another filter; pip install hdf5plugin")


def require_sources(array: Any) -> None:
    """Require all parts of a virtual array: HDF5 would silently read fill values for missing ones."""
    import h5py

    own = Path(array.file.filename)
    for name, part in {(each.file_name, each.dset_name) for each in array.virtual_sources()}:
        places = [own] if name == "." else [own.parent / name, Path(name)]
        if "%" in name:  # a pattern: HDF5 takes whatever files match
            continue
        place = next(filter(Path.is_file, places), None)
        with h5py.File(place, "r") if place else nullcontext({}) as source:
            if part not in source:
                raise ArgumentError(
                    f"{array.name}: expected its part {part} of {name}, which is not there; put it there"
                )
            if source[part].is_virtual:
                require_sources(source[part])


def _is_array(item: Any) -> bool:
    """Return whether an item of HDF5 is an array with samples, and not only the name of a dimension."""
    is_there = hasattr(item, "dtype") and bool(item.shape)
    return is_there and not bytes(item.attrs.get("NAME", b"")).startswith(NO_COORDINATES)
