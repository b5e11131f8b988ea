"""The canonical file of a prepared volume: an NRRD with raw samples, mapped into memory."""

import re
from pathlib import Path
from typing import BinaryIO

import numpy as np

from texgs.core.errors import ArgumentError, located
from texgs.core.io import reading_as
from texgs.volume.grid import Dims, Grid, Triple
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
        source = open_prepared(path)
    return Grid(source.mapped(), source.spacing, source.origin)


def open_prepared(path: Path) -> RawSource:
    """Return a prepared volume as a source."""
    with reading_as("an NRRD file", f"{MAKES} again"):
        fields, offset = read_fields(path)
        encoding = fields["encoding"]
        if encoding != "raw":
            raise ArgumentError(f"expected a prepared volume with raw encoding, got {encoding}; {MAKES}")
        nx, ny, nz = map(int, fields["sizes"].split())
        dx, _, _, _, dy, _, _, _, dz = map(float, NUMBER.findall(fields["spacedirections"]))
        x, y, z = map(float, NUMBER.findall(fields["spaceorigin"]))
        stored = np.dtype({word: name for name, word in WORDS.items()}[fields["type"]]).newbyteorder("<")
        return RawSource(path, (nx, ny, nz), stored, offset, (dx, dy, dz), (x, y, z))


def write_header(file: BinaryIO, dims: Dims, dtype: np.dtype, spacing: Triple, origin: Triple) -> int:
    """Write the header of a canonical file, and return its length, a multiple of `ALIGNMENT` bytes.

    Raw samples follow, little endian, of one of the types in `WORDS`.
    """
    dx, dy, dz = spacing
    directions = " ".join(_vector(step) for step in ((dx, 0, 0), (0, dy, 0), (0, 0, dz)))
    lines = [
        "NRRD0004",
        f"type: {WORDS[dtype.name]}",
        "dimension: 3",
        "space: 3D-right-handed",
        f"sizes: {dims[0]} {dims[1]} {dims[2]}",
        f"space directions: {directions}",
        "kinds: domain domain domain",
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
