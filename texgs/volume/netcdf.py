"""HDF5 and NetCDF-4, by h5py, and classic NetCDF, by xarray: VTK fills up what is cut off with zeros."""

import posixpath
from contextlib import suppress
from importlib import import_module
from math import ceil, prod
from pathlib import Path
from typing import Any

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.core.io import reading_as
from texgs.volume.axes import nameless
from texgs.volume.grid import Triple
from texgs.volume.layers import LayerSource, lazy, one_of

CLASSIC = (b"CDF\x01", b"CDF\x02")  # the latter with offsets of 64 bits
NO_COORDINATES = b"This is a netCDF dimension but not a netCDF variable"  # begins the NAME of such a scale
# NetCDF's values of samples that were never written, where a file names none; bytes have none.
NEVER_WRITTEN: dict[str, float] = {
    **{"i2": -32767, "u2": 2**16 - 1, "i4": 1 - 2**31, "u4": 2**32 - 1, "i8": 2 - 2**63, "u8": 2**64 - 2},
    **{"f4": 9.969209968386869e36, "f8": 9.969209968386869e36},
}


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
        opener = _classic if start in CLASSIC else _hdf5
        field, more = opener(path, variable)
        return LayerSource(path, field, (spacing, origin), **more, **keys)


def _classic(path: Path, variable: str | None) -> tuple[Any, dict[str, Any]]:
    """Return a variable of classic NetCDF, and nothing more about it."""
    import xarray

    file = xarray.open_dataset(path, engine="scipy", decode_cf=False, cache=False)
    field = file[one_of({str(name): file[name] for name in file.variables}, variable)]
    return field.assign_attrs(never_written(field) | field.attrs), {}


def never_written(array: Any) -> dict[str, Any]:
    """Return the attribute that names the value of samples of NetCDF that were never written."""
    code = NEVER_WRITTEN.get(np.dtype(array.dtype).str[1:])
    return {} if code is None else {"_FillValue": code}


def _hdf5(path: Path, variable: str | None) -> tuple[Any, dict[str, Any]]:
    """Return an array of HDF5, with what `LayerSource` needs to know about it."""
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
    if asked and _is_array(file.get(asked)):  # also by the path of a link
        arrays[asked] = file[asked]
    array = arrays[one_of(arrays, variable)]
    require_filters(array)
    require_sources(array)
    field = lazy(array, *labels_of(array))
    if "_NCProperties" in file.attrs:
        field = field.assign_attrs(never_written(field) | field.attrs)
    notes = [gaps_in(array), *(f"{name} {what}" for name, what in broken.items())]
    return field, {"chunks": array.chunks, "note": "; ".join(filter(None, notes))}


def labels_of(array: Any) -> tuple[list[str], dict[str, Any]]:
    """Return the names of the axes of an array, and the scales of dimensions that hold their coordinates."""
    scales = [axis[0] if len(axis) else None for axis in array.dims]
    labels = [axis.label or f"?{k}" for k, axis in enumerate(array.dims)]
    pairs = zip(scales, labels, strict=True)
    names = [label if scale is None else posixpath.basename(scale.name) for scale, label in pairs]
    if len({*names}) < len(names) or all(name.startswith("?") for name in names):
        return nameless(array.shape), {}
    rows = zip(names, scales, array.shape, strict=True)
    return names, {name: x for name, x, n in rows if x is not None and x.shape == (n,) and _is_array(x)}


def arrays_in(file: Any) -> tuple[dict[str, Any], dict[str, str]]:
    """Return arrays by their paths, also those behind links; and what is missing, by the paths of links."""
    import h5py

    items: dict[str, Any] = {}
    links: dict[str, Any] = {}
    file.visititems(lambda name, item: items.update({name: item}))
    file.visititems_links(lambda name, link: links.update({name: link}))
    broken, own = {}, [*items.values()]
    for name, link in links.items():
        if isinstance(link, h5py.HardLink):
            continue
        item = file.get(name)
        if item is None:
            broken[name] = f"links to {getattr(link, 'filename', link.path)}, which is not there"
        elif item not in own:
            items[name] = item
            if isinstance(item, h5py.Group):
                item.visititems(lambda below, each, name=name: items.update({f"{name}/{below}": each}))
    return {name: item for name, item in items.items() if _is_array(item)}, broken


def require_filters(array: Any) -> None:
    """Require what unpacks the chunks of an array."""
    import h5py

    stored = array.id.get_create_plist()
    codes = [stored.get_filter(k)[0] for k in range(stored.get_nfilters())]
    stored.close()  # HDF5 crashes at the end of a process where it has to close that of a virtual array
    if not all(map(h5py.h5z.filter_avail, codes)):
        raise ArgumentError("expected samples packed by gzip, got another filter; pip install hdf5plugin")


def require_sources(array: Any) -> None:
    """Require the arrays that a virtual one is made of: HDF5 gives its fill value for what is not there."""
    import h5py

    if not array.is_virtual:
        return
    folder = Path(array.file.filename).parent
    for name, part in {(source.file_name, source.dset_name) for source in array.virtual_sources()}:
        file = array.file.filename if name == "." else name
        if "%" in file:  # a pattern, of which HDF5 takes all that there are
            continue
        places = [place for place in (folder / file, Path(file)) if place.is_file()]
        if not places:
            raise ArgumentError(f"{array.name}: expected its part {name}, which is not there; put it there")
        with h5py.File(places[0], "r") as source:
            if part not in source:
                raise ArgumentError(
                    f"{array.name}: expected {part} in its part {name}, found none; is it whole?"
                )
            require_sources(source[part])


def gaps_in(array: Any) -> str:
    """Say how many chunks of an array were never written, if any."""
    if array.is_virtual or not array.chunks:
        return ""
    count = prod(ceil(n / size) for n, size in zip(array.shape, array.chunks, strict=True))
    missing = count - array.id.get_num_chunks()
    return f"{missing} of {count} chunks were never written and count as {array.fillvalue}" if missing else ""


def _is_array(item: Any) -> bool:
    """Return whether an item of HDF5 is an array with samples, and not only the name of a dimension."""
    is_there = hasattr(item, "dtype") and bool(item.shape)
    return is_there and not bytes(item.attrs.get("NAME", b"")).startswith(NO_COORDINATES)
