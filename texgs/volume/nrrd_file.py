"""The canonical file of a prepared volume: an NRRD with raw samples, mapped into memory."""

import re
from pathlib import Path
from typing import BinaryIO

import numpy as np

from texgs.core.errors import ArgumentError, located
from texgs.core.io import reading_as
from texgs.volume.grid import Dims, Grid, Triple, byte_count
from texgs.volume.headers import read_fields
from texgs.volume.slabs import RawSource

ALIGNMENT = 64  # bytes; where the samples of a canonical file start: cache lines, and any vector type
WORDS = {"int8": "signed char", "uint8": "uchar", "int16": "short", "uint16": "ushort", "float32": "float"}
MAKES = "texgs volume dataset=NAME makes it"
NUMBER = re.compile(r"[-+.\deE]+")


def open_grid(path: str | Path) -> Grid:
    """Map a prepared volume into memory; samples are read when they are used."""
    path = Path(path)
    if not path.is_file():
        raise ArgumentError(f"{path}: no such file; {MAKES}")
    with located(path):
        first, *others = open_prepared(path)
    return Grid(first.mapped(), first.spacing, first.origin, tuple(other.mapped() for other in others))


def open_prepared(path: Path) -> list[RawSource]:
    """Return the channels of a prepared volume as sources; most have one."""
    with reading_as("an NRRD file", f"{MAKES} again"):
        fields, offset = read_fields(path)
        encoding = fields["encoding"]
        if encoding != "raw":
            raise ArgumentError(f"expected a prepared volume with raw encoding, got {encoding}; {MAKES}")
        nx, ny, nz, *n = map(int, fields["sizes"].split())
        directions = fields["spacedirections"].removesuffix("none")
        dx, _, _, _, dy, _, _, _, dz = map(float, NUMBER.findall(directions))
        x, y, z = map(float, NUMBER.findall(fields["spaceorigin"]))
        stored = np.dtype({word: name for name, word in WORDS.items()}[fields["type"]]).newbyteorder("<")
        lattice, size = ((dx, dy, dz), (x, y, z)), byte_count((nx, ny, nz), stored)
        (count,) = n or [1]
        if count < 1:
            raise ArgumentError(f"expected at least one channel, got {count}; {MAKES}")
        return [
            RawSource(path, (nx, ny, nz), stored, offset + channel * size, *lattice)
            for channel in range(count)
        ]


def write_header(
    file: BinaryIO, dims: Dims, dtype: np.dtype, spacing: Triple, origin: Triple, channels: int = 1
) -> int:
    """Write the header of a canonical file, and return its length, a multiple of `ALIGNMENT` bytes.

    Raw samples follow, little endian, of one of the types in `WORDS`; of one channel after the other.
    """
    dx, dy, dz = spacing
    directions = " ".join(_vector(step) for step in ((dx, 0, 0), (0, dy, 0), (0, 0, dz)))
    size, none, kind = (f" {channels}", " none", " list") if channels > 1 else ("", "", "")
    lines = [
        "NRRD0004",
        f"type: {WORDS[dtype.name]}",
        f"dimension: {4 if channels > 1 else 3}",
        "space: 3D-right-handed",
        f"sizes: {dims[0]} {dims[1]} {dims[2]}{size}",
        f"space directions: {directions}{none}",
        f"kinds: domain domain domain{kind}",
        "endian: little",
        "encoding: raw",
        f"space origin: {_vector(origin)}",
    ]
    text = "\n".join(lines) + "\n#"
    # The comment fills up; two line breaks end it and the header.
    text += "-" * (-(len(text) + 2) % ALIGNMENT) + "\n\n"
    return file.write(text.encode("ascii"))


def _vector(numbers: Triple) -> str:
    """Return numbers as NRRD writes a vector, exact to the last bit."""
    return "(" + ",".join(repr(float(number)) for number in numbers) + ")"
