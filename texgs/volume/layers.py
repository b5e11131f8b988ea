"""Arrays inside of files as sources: chosen by their path, decoded, and read in layers of whole chunks."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.core.io import reading_as
from texgs.core.memory import free_memory
from texgs.volume.axes import Axis, Channel, lattice, picked
from texgs.volume.grid import Triple, require_room
from texgs.volume.slabs import SLAB_BYTES, Source, step_note

SHARE = 4  # one layer takes this part of the free memory at most
LISTED = 8  # arrays in a message
CODED = ("scale_factor", "add_offset", "_FillValue", "missing_value")  # attributes of CF: samples to decode
UNSIGNED = "_Unsigned"  # "true" where integers are, although the type of the array has a sign


@dataclass(frozen=True, eq=False)
class StoredArray:
    """An array in a file, whichever library reads it."""

    read: Callable[[tuple[int | slice, ...]], Any]  # samples at an index
    dtype: np.dtype
    axes: Sequence[Axis]
    chunks: Sequence[int]  # samples along each axis that are stored in one piece
    attributes: Mapping[str, Any]
    note: str = ""  # for the user


class LayerSource(Source):
    """A scalar field in an array, of a step of time and of a channel.

    Axes are z, y, x in the order they are stored, unless their names say otherwise, and run upwards with
    coordinates. What is read is layers of whole chunks along z. One stays in memory, so that slabs in order
    read every chunk once; only where a layer takes more than a quarter of the free memory, it is read in
    parts, and its chunks once for each. `given` replaces spacing and origin.
    """

    def __init__(
        self,
        path: Path,
        stored: StoredArray,
        given: tuple[Triple | None, Triple | None],
        channel: str | None = None,
        time: int | None = None,
    ) -> None:
        self._path, self._stored = path, stored
        self._index = picked(stored.axes, channel, time)
        space = [k for k, index in enumerate(self._index) if isinstance(index, slice)]
        names = {stored.axes[k].name.lower(): k for k in space}
        order = [names[name] for name in "zyx"] if {*names} == {*"zyx"} else space
        self._z, self._turn = order[0], [space.index(k) for k in order]
        z, y, x = (stored.axes[k] for k in order)
        self._signs = [-1 if axis.step < 0 else 1 for axis in (z, y, x)]
        numbers = {name: np.ravel(stored.attributes.get(name, "")) for name in CODED}
        self._coded = {k: v[0] for k, v in numbers.items() if v.size == 1 and v.dtype.kind in "iuf"}
        spacing, origin, remark = lattice((x, y, z), *given)
        unsigned = np.ravel(stored.attributes.get(UNSIGNED, "")).astype(str)[0].lower() == "true"
        self._is_unsigned = unsigned and stored.dtype.kind == "i"
        kept = np.dtype(f"u{stored.dtype.itemsize}") if self._is_unsigned else stored.dtype
        dtype = np.dtype(np.float32) if self._coded else kept
        super().__init__(path.name, (x.size, y.size, z.size), dtype, spacing, origin)
        for axis, index in zip(stored.axes, self._index, strict=True):
            if axis.kind == "time":
                self.n_steps = axis.size
            elif axis.kind == "channel" and isinstance(index, int):
                self.channels = axis.channels or (Channel(),) * axis.size
                self.channel = self.channels[index]
        self.note = "; ".join(filter(None, (stored.note, step_note(time or 0, self.n_steps), remark)))
        plane, chunk = x.size * y.size * stored.dtype.itemsize, stored.chunks[self._z]
        most = max(1, free_memory() // (SHARE * plane))
        self._depth = min(chunk * max(1, SLAB_BYTES // (chunk * plane)), most)  # slices in a layer
        require_room((x.size, y.size, self._depth), stored.dtype)
        self._first, self._layer = -1, np.empty(0)  # index of its first slice, and the layer in memory

    def slices(self, start: int, stop: int) -> np.ndarray:
        """Return samples [stop - start, Y, X], NaN where they are missing."""
        (sign, *signs), size = self._signs, self.dims[2]
        low, high = (start, stop) if sign > 0 else (size - stop, size - start)  # as stored
        firsts = range(low - low % self._depth, high, self._depth)[::sign]
        parts = [
            self._part(first, max(low, first), min(high, first + self._depth))[::sign] for first in firsts
        ]
        return self._decoded(np.concatenate(parts)[:, :: signs[0], :: signs[1]])

    def _part(self, first: int, low: int, high: int) -> np.ndarray:
        """Return slices low to high - 1, as they are stored, of the layer that begins with `first`."""
        if self._first != first:
            self._first, self._layer = -1, np.empty(0)  # gives its memory back before the next one is read
            index = list(self._index)
            index[self._z] = slice(first, min(first + self._depth, self.dims[2]))
            with reading_as("an array that is whole", where=f"{self._path}: "):
                self._layer = np.asarray(self._stored.read(tuple(index))).transpose(self._turn)
            self._first = first
        return self._layer[low - first : high - first]

    def _decoded(self, values: np.ndarray) -> np.ndarray:
        """Return samples of the source's type: packed ones by scale and offset, NaN for missing ones."""
        codes = [np.asarray(self._coded[name]) for name in CODED[2:] if name in self._coded]
        if values.dtype.kind == "f":  # a code may be written with more digits than samples have
            with np.errstate(over="ignore"):
                codes = [code.astype(values.dtype) for code in codes]
        missing = [values == code for code in codes]
        values = values.view(values.dtype.str.replace("i", "u")) if self._is_unsigned else values
        scale, offset = (self._coded.get(name) for name in CODED[:2])
        if scale is not None or offset is not None:
            values = values * np.float64(1 if scale is None else scale) + (offset or 0)
        with np.errstate(over="ignore"):  # `prepare` tells of samples that do not fit
            values = values.astype(self.dtype, copy=False)
        return np.where(np.any(missing, axis=0), self.dtype.type(np.nan), values) if missing else values


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
