"""Axes of arrays in files: which are those of space, how samples lie along them, and one index of others."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.volume.grid import ONES, ZEROS, Triple

UNEVEN = 0.01  # of the mean distance: coordinates are often rounded to float32
COMPONENTS = (2, 3, 4)  # sizes of a last axis without a name that is none of space
POWERS = {"nano": -9, "micro": -6, "milli": -3, "centi": -2, "": 0, "kilo": 3}
METRES = {unit: 10.0**n for prefix, n in POWERS.items() for unit in (f"{prefix}meter", f"{prefix[:1]}m")}
METRES |= {"um": 1e-6, "µm": 1e-6, "angstrom": 1e-10}
PRESSURES = ("Pa", "hPa", "kPa", "mbar", "millibar", "dbar", "decibar", "bar")


@dataclass(frozen=True)
class Channel:
    """What a file says of a channel: its name, and how it is shown, if it says that at all."""

    label: str = ""
    color: tuple[float, float, float] = (1.0, 1.0, 1.0)  # red, green, blue
    window: tuple[float, float] | None = None  # the values that are black and of the full colour


@dataclass(frozen=True)
class Axis:
    """A dimension of an array: sample i lies at start + i * step in its unit, as far as they are even."""

    name: str
    size: int
    unit: str = "samples"
    start: float = 0.0
    step: float = 1.0  # below 0 where coordinates fall
    is_even: bool = True
    channels: tuple[Channel, ...] = ()  # one for each sample, or none

    @property
    def kind(self) -> str:
        """Return time, channel or space, by the name, or a unit such as "days since 2000-01-01"."""
        if self.name.lower() in ("t", "time") or " since " in self.unit:
            return "time"
        return "channel" if self.name.lower() in ("c", "channel") else "space"


def nameless(shape: Sequence[int]) -> list[Axis]:
    """Return axes of an array that tells nothing about them: (t, (c,)) z, y, x, or z, y, x and components."""
    known = {4: "zyxc" if shape[-1] in COMPONENTS else "tzyx", 5: "tczyx"}
    names = "?" * len(shape) if sum(n > 1 for n in shape) == 3 else known.get(len(shape), "?" * len(shape))
    return [Axis(name, n) for name, n in zip(names, shape, strict=True)]


def along(name: str, size: int, scale: Any = None) -> Axis:
    """Return an axis with its coordinates, where there is an array of them, and their unit.

    Coordinates that count downwards, as depth and pressure do, are those of the axis upwards with the other
    sign.
    """
    if size < 2 or getattr(scale, "shape", ()) != (size,):
        return Axis(name, size)
    places = np.array(scale[:], np.float64)
    unit, positive = told(scale, "units"), told(scale, "positive")
    if positive.lower() == "down" or (unit in PRESSURES and not positive):
        places = -places
    step = float(places[-1] - places[0]) / (size - 1)
    is_even = bool(np.abs(np.diff(places) - step).max() <= UNEVEN * abs(step))
    return Axis(name, size, unit, float(places[0]), step, is_even)


def told(scale: Any, name: str) -> str:
    """Return an attribute of coordinates as text, whichever library reads them; empty where there is none."""
    value = getattr(scale, name, b"") or getattr(scale, "attrs", {}).get(name, "")  # of SciPy, of others
    return value.decode(errors="replace") if isinstance(value, bytes) else str(value)


def picked(axes: Sequence[Axis], channel: str | None, time: int | None) -> list[int | slice]:
    """Return one index for each axis that is none of space or of size 1, all of the three others."""
    said = {kind: str(value) for kind, value in (("time", time), ("channel", channel)) if value is not None}
    is_space = [axis.kind == "space" and axis.size > 1 for axis in axes]
    sizes = " x ".join(f"{axis.name} {axis.size}" for axis in axes)
    if sum(is_space) != 3:
        raise ArgumentError(f"expected three axes of space besides time and channel, got {sizes}")
    if unfit := said.keys() - {axis.kind for axis in axes}:
        raise ArgumentError(f"dataset.volume.{min(unfit)}: there is no such axis in {sizes}; leave it out")
    pairs = zip(axes, is_space, strict=True)
    return [slice(None) if is_kept else _place(axis, said.get(axis.kind, "")) for axis, is_kept in pairs]


def _place(axis: Axis, wanted: str) -> int:
    """Return the index of a channel by its label or number, or of a step of time, by default the first."""
    numbers = [str(k) for k in range(axis.size)]
    wanted = wanted or ("0" if axis.size == 1 or axis.kind == "time" else "")
    labels = [channel.label for channel in axis.channels] if axis.kind == "channel" else []
    for names in (labels, numbers):
        if wanted in names:
            return names.index(wanted)
    known = ", ".join(map("{} ({})".format, numbers, labels)) or f"0 to {axis.size - 1}"
    key = f"dataset.volume.{axis.kind}" + ", or a basic TF's channel" * (axis.kind == "channel")
    raise ArgumentError(f"{key}: expected one of {known}, got {wanted or 'none'}")


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
        remark = f"units along x, y, z are {', '.join(units)}, so that samples are 1 apart"
        return spacing or ONES, origin or ZEROS, "" if spacing else remark
    if spacing is None and (uneven := [axis.name for axis in axes if not axis.is_even]):
        raise ArgumentError(f"expected even distances along {', '.join(uneven)}; resample, or set spacing")
    factors = [METRES[unit] / METRES[units[0]] if is_length else 1.0 for unit in units]
    dx, dy, dz = (abs(axis.step) * factor for axis, factor in zip(axes, factors, strict=True))
    x, y, z = (
        min(axis.start, axis.start + (axis.size - 1) * axis.step) * factor
        for axis, factor in zip(axes, factors, strict=True)
    )
    return spacing or (dx, dy, dz), origin or (x, y, z), ""
