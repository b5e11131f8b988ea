"""The .slc volumes of VolVis as sources: a text header, an icon, and slices that may be run-length coded."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.core.reading import reading_as
from texgs.volume.grid import Dims, Grid, Triple, require_room
from texgs.volume.slabs import ArraySource

MAGIC = 11111
# After the magic number: dims, bits, spacing, unit, origin, modification, compression, icon; X ends it.
HEADER = re.compile(rb"\s*(\d+)((?:\s+[-+.\deE]+){13})\s*X")
LONGEST_HEADER = 1024
SLICE_SIZE = re.compile(rb"\s*(\d{1,12})\s*X")


def open_slc(path: Path, spacing: Triple | None, origin: Triple | None) -> ArraySource:
    """An 8-bit volume, read as a whole.

    Raises:
        ArgumentError: if the file is damaged or of an unknown kind.
    """
    with reading_as("an .slc file"):
        content = path.read_bytes()
        header = HEADER.match(content[:LONGEST_HEADER])
        if not header or int(header[1]) != MAGIC:
            raise ArgumentError("expected an .slc file, but its header is another")
        words = header[2].split()
        x, y, z, bits, *_, compression, icon_width, icon_height = (
            int(word) for word in words[:4] + words[7:]
        )
        sx, sy, sz = (float(word) for word in words[4:7])
        if bits != 8 or compression not in (0, 1):
            raise ArgumentError(
                f"expected 8 bits and compression 0 or 1, got {bits} bits and compression {compression}"
            )
        if min(x, y, z) < 1 or min(icon_width, icon_height) < 0:
            raise ArgumentError(f"expected samples along x, y and z, got {x} x {y} x {z}; is it damaged?")
        require_room((x, y, z), np.dtype(np.uint8))
        samples = content[header.end() + 3 * icon_width * icon_height :]
        if compression:
            samples = _decoded(samples, (x, y, z))
        if len(samples) < x * y * z:
            raise ArgumentError(f"the file is cut off: expected {x * y * z} samples, found {len(samples)}")
        values = np.frombuffer(samples, np.uint8, x * y * z).reshape(z, y, x)
    return ArraySource(Grid(values, spacing or (sx, sy, sz), origin or (0.0, 0.0, 0.0)), path.name)


def _decoded(coded: bytes, dims: Dims) -> bytes:
    """Samples of all slices; each is a length, an X and that many bytes of runs."""
    slices, place = [], 0
    for z in range(dims[2]):
        size = SLICE_SIZE.match(coded, place)
        if not size:
            raise ArgumentError(
                f"the file is cut off or damaged: expected the length of slice {z}, found none"
            )
        place = size.end() + int(size[1])
        decoded = _runs(coded[size.end() : place])
        if len(decoded) != dims[0] * dims[1]:
            raise ArgumentError(
                f"the file is cut off or damaged: expected {dims[0] * dims[1]} samples in slice {z}, "
                f"found {len(decoded)}"
            )
        slices.append(decoded)
    return b"".join(slices)


def _runs(coded: bytes) -> bytes:
    """Samples of one slice: a count of 7 bits, and samples (top bit set) or one that repeats; 0 ends it."""
    decoded, place = bytearray(), 0
    while place < len(coded) and (count := coded[place] & 0x7F):
        if coded[place] & 0x80:
            decoded += coded[place + 1 : place + 1 + count]
            place += 1 + count
        else:
            decoded += coded[place + 1 : place + 2] * count
            place += 2
    return bytes(decoded)
