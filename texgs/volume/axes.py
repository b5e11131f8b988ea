"""Axes of labelled arrays: which are x, y and z, positions of samples, and places on further axes."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.volume.grid import ONES, ZEROS, Triple

if TYPE_CHECKING:
    import xarray

NUMBER = re.compile("0|[1-9][0-9]{0,17}")  # of a channel or step
SPACING_TOLERANCE = 0.01  # of the mean distance: coordinates are often rounded to float32
COMPONENTS = (2, 3, 4)  # sizes of a nameless last axis that holds components
POWERS = {"nano": -9, "micro": -6, "milli": -3, "centi": -2, "": 0, "kilo": 3}
WORDS = ("meter", "metre", "meters", "metres")
METRES = {prefix + word: 10.0**n for prefix, n in POWERS.items() for word in WORDS}
METRES |= {f"{prefix[:1]}m": 10.0**n for prefix, n in POWERS.items() if prefix != "micro"}
METRES |= dict.fromkeys(("um", "µm", "μm", "micron", "microns"), 1e-6) | {"angstrom": 1e-10}
# What CF and cf_xarray call axes, and the letters that they have here.
LETTERS = {"X": "x", "longitude": "x", "Y": "y", "latitude": "y", "Z": "z", "vertical": "z", "T": "t"}
# Attributes of CF: codes of missing samples, scaling of packed ones, bounds of valid ones, and labels.
CODES, PACKED = ("_FillValue", "missing_value"), {"scale_factor": 1.0, "add_offset": 0.0}
NUMBERS = (*CODES, *PACKED, "valid_min", "valid_max", "valid_range")
UNSIGNED_KEY = "_Unsigned"  # "true" for unsigned integers in an array of a signed type
CF_KEYS = (*NUMBERS, UNSIGNED_KEY, "axis", "standard_name", "long_name", "units", "positive")
CF_KEYS += ("cartesian_axis", "grads_dim", "_CoordinateAxisType")  # of others, known to cf_xarray
PRESSURES = ("Pa", "hPa", "kPa", "mbar", "millibar", "dbar", "decibar", "bar")


@dataclass(frozen=True)
class Channel:
    """The name of a channel and its display settings, as far as the file has them."""

    label: str = ""
    color: tuple[float, float, float] = (1.0, 1.0, 1.0)  # red, green, blue
    window: tuple[float, float] | None = None  # values shown as black and as the full colour


@dataclass(frozen=True)
class Axis:
    """A dimension of an array: sample i lies at start + i * step in its unit, as far as they are even."""

    name: str
    size: int
    unit: str = "samples"
    start: float = 0.0
    step: float = 1.0  # negative for falling coordinates
    is_even: bool = True
    channels: tuple[Channel, ...] = ()  # one for each sample, or none
    letter: str = ""  # x, y, z or t, if the file names the direction

    @property
    def kind(self) -> str:
        """Return time, channel or space, by the name, or a unit such as "days since 2000-01-01"."""
        if self.letter == "t" or self.name.lower() in ("t", "time") or " since " in self.unit:
            return "time"
        return "channel" if self.name.lower() in ("c", "ch", "channel") else "space"


def attributes_of(array: Any) -> dict[str, Any]:
    """Return the attributes of CF that an array of h5py, Zarr or xarray has, with bytes as text."""
    said = {key: np.ravel(array.attrs[key]) for key in CF_KEYS if key in array.attrs}
    is_text = {key for key, values in said.items() if values.dtype.kind in "SUO" and values.size == 1}
    words = {key: said[key][0] for key in is_text}
    return said | {k: v.decode(errors="replace") if isinstance(v, bytes) else v for k, v in words.items()}


def nameless(shape: Sequence[int]) -> list[str]:
    """Return default names for nameless axes: (t, (c,)) z, y, x, or z, y, x and components."""
    known = {4: "zyxc" if shape[-1] in COMPONENTS else "tzyx", 5: "tczyx"}
    is_volume = sum(n > 1 for n in shape) == 3
    return [*("" if is_volume else known.get(len(shape), ""))] or [f"?{k}" for k in range(len(shape))]


def axes_of(names: Sequence[Any], shape: Sequence[int], places: Mapping[Any, Any]) -> list[Axis]:
    """Return the axes of an array with labels, as it is stored; `places` are coordinates [n] of some of them.

    Attributes of these tell which axes run along x, y, z and time, as CF has them: `axis`, `standard_name`,
    `units` of degrees and `positive`; else names do, such as lon or depth. cf_xarray knows both.
    """
    import cf_xarray
    import xarray

    known = dict.fromkeys(names, "")
    for criterion, pattern in cf_xarray.criteria.regex.items():
        if letter := LETTERS.get(criterion):
            known |= {name: letter for name in known if pattern.fullmatch(str(name).lower())}
    sizes = dict(zip(names, shape, strict=True))
    own = {name: places[name] for name, n in sizes.items() if getattr(places.get(name), "shape", ()) == (n,)}
    coords = {name: (name, np.asarray(each[:]), attributes_of(each)) for name, each in own.items()}
    labels = xarray.Dataset(coords=coords)
    for criterion, named in {**labels.cf.axes, **labels.cf.coordinates}.items():
        if letter := LETTERS.get(criterion):
            known |= dict.fromkeys(named, letter)
    return [along(str(name), n, labels.coords.get(name), known[name]) for name, n in sizes.items()]


def along(name: str, size: int, places: xarray.DataArray | None = None, letter: str = "") -> Axis:
    """Return an axis with its coordinates, where it has numbers, and their unit.

    Coordinates that count downwards, as depth and pressure do, are those of the axis upwards with the other
    sign.
    """
    if size < 2 or places is None or places.dtype.kind not in "iuf":
        is_date = places is not None and places.dtype.kind in "mM"
        return Axis(name, size, letter="t" if is_date else letter)
    numbers = np.array(places, np.float64)
    unit, positive = (str(places.attrs.get(key, "")) for key in ("units", "positive"))
    if positive.lower() == "down" or (unit in PRESSURES and not positive):
        numbers = -numbers
    step = float(numbers[-1] - numbers[0]) / (size - 1)
    is_even = bool(np.abs(np.diff(numbers) - step).max() <= SPACING_TOLERANCE * abs(step))
    return Axis(name, size, unit, float(numbers[0]), step, is_even, letter=letter)


def upright(axes: Sequence[Axis]) -> tuple[list[int], str]:
    """Return which of three axes of space are z, y and x, with a remark if it is a guess.

    Two that are known tell the third one. Else they are z, y, x in the order they are stored.
    """
    counts = Counter(axis.letter for axis in axes)
    known = {axis.letter: k for k, axis in enumerate(axes) if axis.letter and counts[axis.letter] == 1}
    rest = [k for k in range(3) if k not in known.values()]
    if len(known) > 1:
        return [known[letter] if letter in known else rest[0] for letter in "zyx"], ""
    is_guess = any(axes[k].letter != "zyx"[k] for k in known.values())
    names = ", ".join(axis.name for axis in axes)
    return [0, 1, 2], f"axes {names} are taken for z, y, x, as they are stored" if is_guess else ""


def choose_places(
    axes: Sequence[Axis], channel: str | None = None, time: int | None = None
) -> list[int | slice]:
    """Return a slice for each of the three axes of space, and the place on each other axis."""
    said = {kind: str(value) for kind, value in (("time", time), ("channel", channel)) if value is not None}
    is_space = [axis.kind == "space" and axis.size > 1 for axis in axes]
    sizes = " x ".join(f"{axis.name} {axis.size}" for axis in axes)
    if sum(is_space) != 3:
        raise ArgumentError(f"expected three axes of space besides time and channel, got {sizes}")
    if unfit := said.keys() - {axis.kind for axis in axes}:
        raise ArgumentError(f"dataset.volume.{min(unfit)}: there is no such axis in {sizes}; leave it out")
    pairs = zip(axes, is_space, strict=True)
    return [slice(None) if is_kept else place_on(axis, said.get(axis.kind)) for axis, is_kept in pairs]


def place_on(axis: Axis, wanted: str | int | None) -> int:
    """Return the index of a channel by its label or number, or of a step of time, by default the first."""
    first = "0" if axis.size == 1 or axis.kind == "time" else ""
    name = first if wanted is None else str(wanted)
    labels = [channel.label for channel in axis.channels] if axis.kind == "channel" else []
    if name in labels:
        return labels.index(name)
    if NUMBER.fullmatch(name) and int(name) < axis.size:
        return int(name)
    known = ", ".join(f"{k} ({label})" for k, label in enumerate(labels)) or f"0 to {axis.size - 1}"
    key = f"dataset.volume.{axis.kind}" + ", or a basic TF's channel" * (axis.kind == "channel")
    raise ArgumentError(f"{key}: expected one of {known}, got {name or 'none'}")


def lattice(
    axes: Sequence[Axis], spacing: Triple | None, origin: Triple | None
) -> tuple[Triple, Triple, str]:
    """Return spacing and origin of the axes x, y, z in the unit of x, and a remark where units are unlike.

    Spacing and origin replace those of the axes. Degrees and kilometres, say, tell nothing: samples are then
    1 apart.
    """
    units = [axis.unit for axis in axes]
    is_length = all(unit in METRES for unit in units)
    if len({*units} - {""}) > 1 and not is_length:
        names = ", ".join(unit or "none" for unit in units)
        remark = "" if spacing else f"units along x, y, z are {names}, so that samples are 1 apart"
        return spacing or ONES, origin or ZEROS, remark
    if spacing is None and (uneven := [axis.name for axis in axes if not axis.is_even]):
        raise ArgumentError(f"expected even distances along {', '.join(uneven)}; resample, or set spacing")
    factors = [METRES[unit] / METRES[units[0]] if is_length else 1.0 for unit in units]
    pairs = list(zip(axes, factors, strict=True))
    dx, dy, dz = (abs(axis.step) * factor for axis, factor in pairs)
    x, y, z = (min(axis.start, axis.start + (axis.size - 1) * axis.step) * factor for axis, factor in pairs)
    return spacing or (dx, dy, dz), origin or (x, y, z), ""
