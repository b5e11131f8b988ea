"""The canonical file of a prepared volume: an NRRD with raw samples, mapped into memory."""

import json
import re
from collections.abc import Sequence
from itertools import chain, repeat
from math import hypot
from pathlib import Path
from typing import BinaryIO

import numpy as np

from texgs.core.errors import ArgumentError, errors_at
from texgs.core.io import reading_as
from texgs.volume.grid import Dims, Grid, Triple, byte_count
from texgs.volume.headers import NRRD, UPRIGHT_SPACING, read_fields, spacing_in, unit_in
from texgs.volume.slabs import RawSource
from texgs.volume.space import UNKNOWN_SPACE, Space

ALIGNMENT = 64  # bytes; where the samples of a canonical file start: cache lines, and any vector type
NRRD_TYPES = {
    "int8": "signed char",
    "uint8": "uchar",
    "int16": "short",
    "uint16": "ushort",
    "float32": "float",
}
MASKS = "masksoflabels"  # our own key: how many masks follow the samples that the header tells of
LABELS = "labelsofmasks"  # our own key: labels whose masks are last, as JSON
REMEDY = "texgs volume dataset=NAME makes it"
NUMBER = re.compile(r"[-+.\deE]+")


def open_grid(path: str | Path) -> Grid:
    """Map a prepared volume into memory; samples are read when they are used."""
    path = Path(path)
    if not path.is_file():
        raise ArgumentError(f"{path}: no such file; {REMEDY}")
    with errors_at(path):
        first, *others = open_prepared(path)
    values = [each.mapped() for each in (first, *others)]
    return Grid(values[0], first.spacing, first.origin, tuple(values[1:]), first.space)


def open_prepared(path: Path) -> list[RawSource]:
    """Return the channels of a prepared volume, then masks of labels, as sources; most have one channel."""
    with reading_as("an NRRD file", f"{REMEDY} again"):
        fields, offset = read_fields(path)
        encoding = fields["encoding"]
        if encoding != "raw":
            raise ArgumentError(f"expected a prepared volume with raw encoding, got {encoding}; {REMEDY}")
        nx, ny, nz, *n = map(int, fields["sizes"].split())
        directions = fields["spacedirections"].removesuffix("none")
        vectors = np.reshape(np.array(NUMBER.findall(directions), float), (3, 3))
        dx, dy, dz = spacing_in(fields) or map(hypot, *vectors.T.tolist())
        space = Space.along(vectors, fields["space"], unit_in(fields))
        x, y, z = map(float, NUMBER.findall(fields["spaceorigin"]))
        stored = np.dtype({word: name for name, word in NRRD_TYPES.items()}[fields["type"]]).newbyteorder("<")
        (count,), masks = n or [1], int(fields.get(f"{MASKS}=", "0"))
        if count < 1:
            raise ArgumentError(f"expected at least one channel, got {count}; {REMEDY}")
        channels: list[RawSource] = []
        # One by one: a damaged header may tell of any number, and the first that is not there is refused.
        for dtype in chain(repeat(stored, count), repeat(np.dtype(np.uint8), masks)):
            channels.append(RawSource(path, (nx, ny, nz), dtype, offset, (dx, dy, dz), (x, y, z), space))
            offset += byte_count((nx, ny, nz), dtype)
        labels = json.loads(fields.get(f"{LABELS}=", "[]"))
        for channel, label in zip(channels[::-1], labels[::-1], strict=False):
            channel.label = str(label)
        return channels


def masks_in(path: Path) -> dict[str, RawSource]:
    """Return the masks in a prepared volume, by labels; none in other files."""
    if path.suffix.lower() not in NRRD or f"{LABELS}=" not in read_fields(path)[0]:
        return {}
    return {each.label: each for each in open_prepared(path) if each.label is not None}


def write_header(
    file: BinaryIO,
    dims: Dims,
    dtype: np.dtype,
    spacing: Triple,
    origin: Triple,
    space: Space,
    channels: int,
    masks: int = 0,
    labels: Sequence[str] = (),
) -> int:
    """Write the header of a canonical file, and return its length, a multiple of `ALIGNMENT` bytes.

    Raw samples follow, little endian, of one of the types in `NRRD_TYPES`; of one channel after the other;
    and then masks, uint8, which other programs leave unread. Labels are those of the last channels or masks.
    """
    vectors = (space.axes * np.array(spacing)[:, None]).tolist()
    directions = " ".join(map(_vector, vectors))
    # Lengths of vectors of any direction may differ from the spacing in the last bit.
    pair = [f"{UPRIGHT_SPACING}:={' '.join(repr(float(step)) for step in spacing)}"]
    units = ["space units:" + 3 * f' "{space.unit}"'] if space.unit else []
    size, none, kind = (f" {channels}", " none", " list") if channels > 1 else ("", "", "")
    lines = [
        "NRRD0004",
        f"type: {NRRD_TYPES[dtype.name]}",
        f"dimension: {4 if channels > 1 else 3}",
        f"space: {space.name}",
        f"sizes: {dims[0]} {dims[1]} {dims[2]}{size}",
        f"space directions: {directions}{none}",
        *units,
        f"kinds: domain domain domain{kind}",
        "endian: little",
        "encoding: raw",
        f"space origin: {_vector(origin)}",
        *(pair if space.matrix != UNKNOWN_SPACE.matrix else []),
        *([f"{MASKS}:={masks}"] if masks else []),
        *([f"{LABELS}:={json.dumps(labels)}"] if labels else []),
    ]
    text = ("\n".join(lines) + "\n#").encode()
    # The comment fills up; two line breaks end it and the header.
    return file.write(text + b"-" * (-(len(text) + 2) % ALIGNMENT) + b"\n\n")


def _vector(numbers: Triple) -> str:
    """Return numbers as NRRD writes a vector, exact to the last bit."""
    return "(" + ",".join(repr(float(number)) for number in numbers) + ")"
