"""The extra axis of NRRD and MetaImage besides x, y and z: time, channels, or layers of labels."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.volume.axes import Axis, place_on
from texgs.volume.headers import METAIMAGE, NRRD, read_fields

SPACE_KINDS = ("domain", "space")  # kinds of axes of NRRD
SEQUENCE = ".seq.nrrd"  # of 3D Slicer; its list axis is time
WORD = re.compile(r'\([^)]*\)|"[^"]*"|\S+')  # in a field of NRRD; a vector or a quoted text is one word
TEXTS = ("type", "color")  # fields whose four words do not describe four axes


class ExtraAxis(NamedTuple):
    """Place of the axis, counted from the fastest; its size; and the key that chooses on it."""

    place: int
    size: int
    key: str

    def picked(self, values: np.ndarray, index: int) -> np.ndarray:
        """Return the samples [Z, Y, X] at an index, from all samples in the order of the file."""
        z, y, x = values.shape
        shape = [z // self.size, y, x]
        shape.insert(3 - self.place, self.size)
        return np.moveaxis(values.reshape(shape), 3 - self.place, 0)[index]


def extra_axis(path: Path, time: int | None, channel: str | None) -> tuple[ExtraAxis | None, int]:
    """Return the extra axis, and the chosen place on it, by default the first step."""
    axis = axis_of(path)
    for key, wanted in (("time", time), ("channel", channel)):
        if wanted is not None and (axis is None or axis.key != key):
            raise ArgumentError(f"dataset.volume.{key}: there is no such axis; leave it out")
    if axis is None:
        return None, 0
    return axis, place_on(Axis(axis.key, axis.size), channel if axis.key == "channel" else time)


def axis_of(path: Path) -> ExtraAxis | None:
    """Return the only extra axis of a file, or None if there are none or several."""
    fields, _ = read_fields(path)
    if path.suffix.lower() in METAIMAGE:
        count, sizes = int(fields.get("elementnumberofchannels", "1")), fields.get("dimsize", "").split()
        if count > 1:
            return ExtraAxis(0, count, "channel") if len(sizes) == 3 else None
        return ExtraAxis(3, int(sizes[3]), "time") if len(sizes) == 4 else None
    sizes = fields.get("sizes", "").split()
    kinds = fields.get("kinds", "").split() or WORD.findall(fields.get("spacedirections", ""))
    others = [k for k, kind in enumerate(kinds) if kind not in SPACE_KINDS and kind[0] != "("]
    if len(sizes) != 4 or len(others) > 1:
        return None
    place = others[0] if others else 3
    is_time = not kinds or kinds[place] == "time" or path.name.lower().endswith(SEQUENCE)
    return ExtraAxis(place, int(sizes[place]), "time" if is_time or not others else "channel")


@contextmanager
def one_volume(path: Path, axis: ExtraAxis | None) -> Iterator[Path]:
    """Yield a header without the extra axis, for ITK, which treats a fourth axis differently."""
    if axis is None:
        yield path
        return
    with path.open("rb") as file:
        head = file.read(read_fields(path)[1]).decode("latin-1")
    with TemporaryDirectory() as folder:
        header = Path(folder) / path.name
        lines = [without_axis(line, axis.place, path.suffix.lower() in NRRD) for line in head.splitlines()]
        header.write_text("\n".join([*lines, "", ""]), encoding="latin-1")
        yield header


def without_axis(line: str, place: int, is_nrrd: bool) -> str:
    """Return a line of a header without the words for one axis, in a list of four or in a matrix."""
    name, mark, value = line.partition(":" if is_nrrd else "=")
    key, words = name.replace(" ", "").strip().lower(), WORD.findall(value)
    if key == "datafile" or value.startswith("="):  # pairs of key and value are for others
        return "#"
    if key in ("dimension", "ndims", "elementnumberofchannels"):
        words = ["1" if key.startswith("element") else "3"]
    elif len(words) == 4 and key not in TEXTS:
        del words[place]
    elif len(words) == 16:
        words = [word for k, word in enumerate(words) if k < 12 and k % 4 < 3]
    else:
        return line
    return f"{name}{mark} {' '.join(words)}"
