"""Arrays with labels as sources: decoded as CF says, by xarray, and read in layers of whole chunks.

Files are opened by the libraries of their formats: xarray's own engines give up on a group of HDF5 with a
link to nowhere or a type that NetCDF lacks, and on one of Zarr in which a single array has no labels.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.core.io import reading_as
from texgs.core.memory import free_memory
from texgs.volume.axes import METRES, Axis, axes_of, lattice, picked, upright
from texgs.volume.grid import Triple, require_room
from texgs.volume.slabs import SLAB_BYTES, Source
from texgs.volume.space import Space

if TYPE_CHECKING:
    import xarray

SHARE = 4  # one layer takes this part of the free memory at most
LISTED = 8  # arrays in a message
EVERYTHING = (-np.inf, np.inf)
# Attributes of CF: what stands for missing samples; how packed ones are scaled; which are valid; and others.
CODES, PACKED = ("_FillValue", "missing_value"), {"scale_factor", "add_offset"}
NUMBERS = (*CODES, *PACKED, "valid_min", "valid_max", "valid_range")
UNSIGNED = "_Unsigned"  # "true" where integers are, although the type of the array has a sign
CF = (*NUMBERS, UNSIGNED, "axis", "standard_name", "long_name", "units", "positive")


class LayerSource(Source):
    """A scalar field in an array, of a step of time and of a channel.

    Axes are z, y, x as `upright` has them, and run upwards with coordinates. What is read is layers of whole
    chunks along z. One stays in memory, so that slabs in order read every chunk once; only where a layer
    takes more than a quarter of the free memory, it is read in parts, and its chunks once for each.

    Args:
        name: of the file, for messages.
        field: as it is stored, read where it is indexed; attributes of CF say how to decode it.
        given: spacing and origin that replace those of the axes.
        channel: label or number of one of several.
        time: step of several.
        axes: where they are not those of the labels.
        chunks: samples along each axis that are stored in one piece.
        note: for the user.
    """

    def __init__(
        self,
        name: str | Path,
        field: xarray.DataArray,
        given: tuple[Triple | None, Triple | None],
        channel: str | None = None,
        time: int | None = None,
        *,
        axes: Sequence[Axis] | None = None,
        chunks: Sequence[int] | None = None,
        note: str = "",
    ) -> None:
        self._name, axes = name, axes or axes_of(field)
        self._index = picked(axes, channel, time)
        space = [k for k, index in enumerate(self._index) if isinstance(index, slice)]
        self._turn, guess = upright([axes[k] for k in space])
        z, y, x = (axes[space[k]] for k in self._turn)
        self._z = space[self._turn[0]]
        self._signs = [-1 if axis.step < 0 else 1 for axis in (z, y, x)]
        spacing, origin, remark = lattice((x, y, z), *given)
        self._samples, self._valid = decoded(field)
        is_float = [each.dtype.kind == "f" for each in (field, self._samples)]
        is_masked = is_float == [False, True] or self._valid != EVERYTHING
        dtype = np.dtype(np.float32) if is_masked else self._samples.dtype
        super().__init__(Path(name).name, (x.size, y.size, z.size), dtype, spacing, origin)
        self.space = Space(unit=x.unit if x.unit in METRES and not remark else "")
        self.take(axes, self._index)
        self.note = "; ".join(filter(None, (note, self.note, guess, remark)))
        plane, chunk = x.size * y.size * self.dtype.itemsize, chunks[self._z] if chunks else 1
        most = max(1, free_memory() // (SHARE * plane))
        self._depth = min(chunk * max(1, SLAB_BYTES // (chunk * plane)), most)  # slices in a layer
        require_room((x.size, y.size, self._depth), self.dtype)
        self._first, self._layer = -1, np.empty(0)  # index of its first slice, and the layer in memory

    def slices(self, start: int, stop: int) -> np.ndarray:
        """Return samples [stop - start, Y, X], NaN where they are missing."""
        (sign, *signs), size = self._signs, self.dims[2]
        low, high = (start, stop) if sign > 0 else (size - stop, size - start)  # as stored
        firsts = range(low - low % self._depth, high, self._depth)[::sign]
        parts = [
            self._part(first, max(low, first), min(high, first + self._depth))[::sign] for first in firsts
        ]
        values = np.concatenate(parts)[:, :: signs[0], :: signs[1]]
        if self._valid != EVERYTHING:
            values = np.where((values < self._valid[0]) | (values > self._valid[1]), np.nan, values)
        with np.errstate(over="ignore"):  # `prepare` tells of samples that do not fit
            return values.astype(self.dtype, copy=False)

    def _part(self, first: int, low: int, high: int) -> np.ndarray:
        """Return slices low to high - 1, as they are stored, of the layer that begins with `first`."""
        if self._first != first:
            self._first, self._layer = -1, np.empty(0)  # gives its memory back before the next one is read
            index = list(self._index)
            index[self._z] = slice(first, min(first + self._depth, self.dims[2]))
            with reading_as("an array that is whole", where=f"{self._name}: "):
                self._layer = self._samples[tuple(index)].values.transpose(self._turn)
            self._first = first
        return self._layer[low - first : high - first]


def one_of(arrays: Mapping[str, Any], variable: str | None) -> str:
    """Return the path of the array that is named, or of the only one that may be a field.

    `arrays` have a shape and a type each. Fields may have axes of time and channels besides three.
    """
    is_field = {
        k: v.dtype.kind in "biuf" and 3 <= sum(n > 1 for n in v.shape) <= 5 for k, v in arrays.items()
    }
    fields = sorted(name for name in arrays if is_field[name])
    name = fields[0] if len(fields) == 1 and not variable else (variable or "").strip("/")
    if is_field.get(name):
        return name
    got, more = variable or "none", f" and {len(fields) - LISTED} more" if len(fields) > LISTED else ""
    if name in arrays:
        got = f"{name or '/'} of {' x '.join(map(str, arrays[name].shape))} {arrays[name].dtype}"
    raise ArgumentError(
        "dataset.volume.variable: expected an array of real numbers with three axes or more, got "
        f"{got}; choose one of {', '.join(each or '/' for each in fields[:LISTED]) or 'another file'}{more}"
    )


def lazy(array: Any, names: Sequence[str], places: Mapping[str, Any]) -> xarray.DataArray:
    """Return an array of h5py or Zarr with labels, whose samples are read when it is indexed.

    `places` are arrays with the coordinates [n] of some of its axes.
    """
    import xarray

    coords = {name: (name, each[:], attributes_of(each)) for name, each in places.items()}
    samples = xarray.core.indexing.LazilyIndexedArray(_backend()(array))
    return xarray.DataArray(samples, coords, names, attrs=attributes_of(array))


@cache
def _backend() -> type:
    """Return the class of arrays in files that xarray indexes; made late, as xarray takes half a second."""
    from xarray.backends import BackendArray
    from xarray.core.indexing import IndexingSupport, explicit_indexing_adapter

    class StoredArray(BackendArray):
        def __init__(self, array: Any) -> None:
            self.array, self.shape, self.dtype = array, array.shape, array.dtype

        def __getitem__(self, key: Any) -> Any:
            read = self.array.__getitem__
            return explicit_indexing_adapter(key, self.shape, IndexingSupport.BASIC, read)

    return StoredArray


def attributes_of(array: Any) -> dict[str, Any]:
    """Return the attributes of CF that an array of h5py or Zarr has, with bytes as text."""
    said = {key: np.ravel(array.attrs[key]) for key in CF if key in array.attrs}
    is_text = {key for key, values in said.items() if values.dtype.kind in "SUO" and values.size == 1}
    words = {key: said[key][0] for key in is_text}
    return said | {k: v.decode(errors="replace") if isinstance(v, bytes) else v for k, v in words.items()}


def decoded(field: xarray.DataArray) -> tuple[xarray.Variable, tuple[float, float]]:
    """Return samples, still to be read, as attributes of CF say they are, and the range that is valid.

    Packed ones are scaled; NaN stands for each code of missing ones. Numbers may be written as text.
    """
    import xarray

    said = {key: numbers(key, field) for key in NUMBERS if np.size(field.attrs.get(key, ())) > 0}
    coding: dict[str, Any] = {key: said[key] for key in CODES if key in said}
    coding |= {key: float(said[key][0]) for key in PACKED if key in said}
    if str(field.attrs.get(UNSIGNED, "")).lower() == "true" and field.dtype.kind == "i":
        coding[UNSIGNED] = "true"
    samples = field.variable.copy(deep=False)
    samples.attrs = coding
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", xarray.SerializationWarning)  # of several codes
        samples = xarray.decode_cf(xarray.Dataset({"field": samples}), decode_times=False)["field"].variable
    return samples, valid_range(said)


def valid_range(said: Mapping[str, np.ndarray]) -> tuple[float, float]:
    """Return the least and the largest valid sample, after decoding; whole numbers are of packed samples."""
    low, high = said.get("valid_range", EVERYTHING)
    low, high = said.get("valid_min", [low])[0], said.get("valid_max", [high])[0]
    if not said.keys() & PACKED or np.asarray(high).dtype.kind == "f":
        return float(low), float(high)
    scale, offset = said.get("scale_factor", [1.0])[0], said.get("add_offset", [0.0])[0]
    first, last = sorted((float((low - 0.5) * scale + offset), float((high + 0.5) * scale + offset)))
    return first, last


def numbers(key: str, field: xarray.DataArray) -> np.ndarray:
    """Return the numbers [n] of an attribute; codes as samples have them, which may have fewer digits."""
    values = np.ravel(field.attrs[key])
    try:
        values = values if values.dtype.kind in "iuf" else values.astype(np.float64)
    except ValueError:
        raise ArgumentError(f"{key}: expected a number, got {field.attrs[key]}; correct the file") from None
    with np.errstate(over="ignore"):
        return values.astype(field.dtype) if key in CODES and field.dtype.kind == "f" else values
