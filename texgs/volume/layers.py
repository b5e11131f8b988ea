"""Arrays with axes as sources, read in layers of whole chunks and decoded as CF says.

Files are opened by the libraries of their formats: xarray's own engines give up on a group of HDF5 with a
link to nowhere or a type that NetCDF lacks, and on one of Zarr in which a single array has no labels.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from math import ceil, prod
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.core.io import reading_as
from texgs.core.memory import free_memory
from texgs.volume.axes import (
    CODES,
    METRES,
    NUMBERS,
    PACKED,
    UNSIGNED_KEY,
    Axis,
    axes_of,
    choose_places,
    lattice,
    upright,
)
from texgs.volume.grid import Triple, require_room
from texgs.volume.slabs import SLAB_BYTES, Source
from texgs.volume.space import Space

if TYPE_CHECKING:
    import xarray

MEMORY_PARTS = 4  # a layer takes at most a quarter of the free memory
MAX_LISTED = 8  # arrays in a message
ALL_VALUES = (-np.inf, np.inf)


class LayerSource(Source):
    """A scalar field in an array, of a step of time and of a channel.

    Axes are z, y, x as `upright` has them, and run upwards with coordinates. What is read is layers of whole
    chunks along z. One stays in memory, so that slabs in order read every chunk once; only where a layer
    takes more than a quarter of the free memory, it is read in parts, and its chunks once for each.

    Args:
        name: of the file, for messages.
        array: what is read where it is indexed, with a shape and a type.
        axes: of the array.
        attributes: those of CF, which say how samples are decoded.
        given: spacing and origin that replace those of the axes.
        chunks: samples along each axis that are stored in one piece.
        note: for the user.
        keys: channel and time, see `picked`.
    """

    def __init__(
        self,
        name: str | Path,
        array: Any,
        axes: Sequence[Axis],
        attributes: Mapping[str, Any],
        given: tuple[Triple | None, Triple | None],
        chunks: Sequence[int] | None = None,
        note: str = "",
        **keys: Any,
    ) -> None:
        self._name, self._array = name, array
        self._index = choose_places(axes, **keys)
        space = [k for k, index in enumerate(self._index) if isinstance(index, slice)]
        self._turn, guess = upright([axes[k] for k in space])
        z, y, x = (axes[space[k]] for k in self._turn)
        self._z = space[self._turn[0]]
        self._signs = [-1 if axis.step < 0 else 1 for axis in (z, y, x)]
        spacing, origin, remark = lattice((x, y, z), *given)
        self._coding = coding_of(attributes, array.dtype)
        dtype = decode(np.empty(0, array.dtype), *self._coding).dtype
        super().__init__(Path(name).name, (x.size, y.size, z.size), dtype, spacing, origin)
        self.space = Space(unit=x.unit if x.unit in METRES and not remark else "")
        self.take(axes, self._index)
        self.note = "; ".join(filter(None, (note, self.note, guess, remark)))
        plane, chunk = x.size * y.size * self.dtype.itemsize, chunks[self._z] if chunks else 1
        most = max(1, free_memory() // (MEMORY_PARTS * plane))
        self._depth = min(chunk * max(1, SLAB_BYTES // (chunk * plane)), most)  # slices in a layer
        require_room((x.size, y.size, self._depth), self.dtype)
        self._first, self._kept = -1, np.empty(0)  # first slice of the layer in memory, and its samples

    def slices(self, start: int, stop: int) -> np.ndarray:
        """Return samples [stop - start, Y, X]; missing ones are NaN."""
        (sign, *signs), size = self._signs, self.dims[2]
        low, high = (start, stop) if sign > 0 else (size - stop, size - start)  # as stored
        firsts = range(low - low % self._depth, high, self._depth)[::sign]
        parts = [self._layer(first)[max(low - first, 0) : high - first][::sign] for first in firsts]
        values = np.concatenate(parts)[:, :: signs[0], :: signs[1]]
        return values.astype(self.dtype, copy=False)

    def _layer(self, first: int) -> np.ndarray:
        """Return the layer that begins with a slice, in the order of the file."""
        if self._first != first:
            self._first, self._kept = -1, np.empty(0)  # frees the memory before the next layer is read
            index = list(self._index)
            index[self._z] = slice(first, min(first + self._depth, self.dims[2]))
            with reading_as("an array that is whole", where=f"{self._name}: "):
                samples = np.asarray(self._array[tuple(index)]).transpose(self._turn)
                self._first, self._kept = first, decode(samples, *self._coding)
        return self._kept


def coding_of(attributes: Mapping[str, Any], dtype: np.dtype) -> tuple[dict[str, Any], tuple[float, float]]:
    """Return how samples of a type are coded, by attributes of CF, and the range of those that are valid.

    Numbers may be written as text. Codes are as samples have them, which may have fewer digits. The range is
    that after decoding; one of whole numbers is of packed samples.
    """
    said: dict[str, np.ndarray] = {}
    for key in (each for each in NUMBERS if np.size(attributes.get(each, ())) > 0):
        values = np.ravel(attributes[key])
        try:
            values = values if values.dtype.kind in "iuf" else values.astype(np.float64)
        except ValueError:
            raise ArgumentError(f"{key}: expected a number, got {values[0]}; correct the file") from None
        with np.errstate(over="ignore"):
            said[key] = values.astype(dtype) if key in CODES and dtype.kind == "f" else values
    coding: dict[str, Any] = {key: said[key] for key in CODES if key in said}
    coding |= {key: float(said[key][0]) for key in PACKED if key in said}
    if str(attributes.get(UNSIGNED_KEY, "")).lower() == "true" and dtype.kind == "i":
        coding[UNSIGNED_KEY] = "true"
    low, high = said.get("valid_range", ALL_VALUES)
    low, high = said.get("valid_min", [low])[0], said.get("valid_max", [high])[0]
    if coding.keys() & PACKED and any(np.asarray(end).dtype.kind in "iu" for end in (low, high)):
        scale, offset = (coding.get(key, default) for key, default in PACKED.items())
        low, high = sorted(((low - 0.5) * scale + offset, (high + 0.5) * scale + offset))
    return coding, (float(low), float(high))


def decode(values: np.ndarray, coding: Mapping[str, Any], valid: tuple[float, float]) -> np.ndarray:
    """Return samples as `coding_of` says they are: packed ones are scaled, NaN stands for those that miss.

    Integers become float32 where any of this is said.
    """
    import xarray

    stored = xarray.Variable([*map(str, range(values.ndim))], values, coding)
    with warnings.catch_warnings(), np.errstate(over="ignore"):  # `prepare` reports samples that do not fit
        warnings.simplefilter("ignore", xarray.SerializationWarning)  # of several codes
        samples = xarray.conventions.decode_cf_variable("field", stored, decode_times=False).values
        if valid != ALL_VALUES:
            samples = np.where((samples < valid[0]) | (samples > valid[1]), np.nan, samples)
        is_new = samples.dtype.kind == "f" != values.dtype.kind
        return samples.astype(np.float32) if is_new else samples


def one_of(arrays: Mapping[str, Any], variable: str | None) -> str:
    """Return the path of the array that is named, or of the only one that may be a field.

    `arrays` have a shape and a type each. Fields may have axes of time and channels besides three.
    """
    kinds = {name: (array.dtype.kind, sum(n > 1 for n in array.shape)) for name, array in arrays.items()}
    fields = sorted(name for name, (kind, n_axes) in kinds.items() if kind in "biuf" and 3 <= n_axes <= 5)
    name = fields[0] if len(fields) == 1 and not variable else (variable or "").strip("/")
    if name in fields:
        return name
    got, n_more = variable or "none", len(fields) - MAX_LISTED
    if name in arrays:
        got = f"{name or '/'} of {' x '.join(map(str, arrays[name].shape))} {arrays[name].dtype}"
    known = ", ".join(each or "/" for each in fields[:MAX_LISTED]) or "another file"
    known += f" and {n_more} more" if n_more > 0 else ""
    raise ArgumentError(
        "dataset.volume.variable: expected an array of real numbers with three axes or more, got "
        f"{got}; choose one of {known}"
    )


def labelled_source(
    name: str | Path, field: xarray.DataArray, given: tuple[Triple | None, Triple | None], **keys: Any
) -> LayerSource:
    """Return an array of xarray, whose labels say where its axes run; keys are those of `LayerSource`."""
    axes = axes_of(field.dims, field.shape, field.coords)
    chunks = field.encoding.get("chunksizes")
    return LayerSource(name, field.variable, axes, field.attrs, given, chunks=chunks, **keys)


def gaps_in(array: Any, pieces: Sequence[int], n_written: int, fill: Any) -> str:
    """Say how many pieces of an array were never written or are lost, if any, and what stands for them."""
    count = prod(ceil(n / size) for n, size in zip(array.shape, pieces, strict=True))
    missing = count - n_written
    return f"{missing} of {count} chunks are not there and count as {fill}" if missing else ""
