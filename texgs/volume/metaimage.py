"""MetaImage volumes (.mha, or .mhd with a file of samples beside it) as sources."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.core.names import named_file
from texgs.core.reading import reading_as
from texgs.volume.grid import Grid, Triple, byte_count, check_lattice
from texgs.volume.oriented import ONES, ZEROS, oriented
from texgs.volume.packed import unpacked
from texgs.volume.slabs import ArraySource, RawSource, Source

TYPES = {
    "MET_CHAR": "i1",
    "MET_UCHAR": "u1",
    "MET_SHORT": "i2",
    "MET_USHORT": "u2",
    "MET_INT": "i4",
    "MET_UINT": "u4",
    "MET_LONG_LONG": "i8",
    "MET_ULONG_LONG": "u8",
    "MET_FLOAT": "f4",
    "MET_DOUBLE": "f8",
}
# A header is short; a foreign file may hold no line break for gigabytes.
LONGEST_LINE = 4096
MOST_FIELDS = 1000


def open_metaimage(path: Path, spacing: Triple | None, origin: Triple | None) -> Source:
    """Samples are read on demand, or as a whole where they are compressed.

    Axes are turned to the closest ones of space, as the direction matrix says.

    Raises:
        ArgumentError: if the file is damaged or no scalar volume.
    """
    with reading_as("a MetaImage file"):
        fields, header_size = _read_fields(path)
        channels = int(fields.get("ElementNumberOfChannels", "1"))
        if channels != 1:
            raise ArgumentError(f"expected a scalar volume, got {channels} components per sample")
        if fields.get("BinaryData", "True").lower() == "false":
            raise ArgumentError("expected binary samples, got text; save it as binary")
        dims = tuple(int(size) for size in fields["DimSize"].split())
        if len(dims) != 3:
            raise ArgumentError(f"expected 3 axes, got DimSize {list(dims)}")
        stored = _stored_type(fields)
        lattice = (
            ONES if spacing else _triple(fields, ("ElementSpacing", "ElementSize"), 1.0),
            ZEROS if origin else _triple(fields, ("Offset", "Position", "Origin"), 0.0),
        )
        check_lattice(dims, stored, *lattice)
        turned = partial(oriented, directions=_directions(fields), spacing=spacing, origin=origin)
        data, offset = _data_file(path, fields, header_size, byte_count(dims, stored))
        if fields.get("CompressedData", "False").lower() == "true":
            values = unpacked(data, offset, dims, stored)
            return turned(ArraySource(Grid(values, *lattice), path.name))
    return turned(RawSource(data, dims, stored, offset, *lattice))


def _read_fields(path: Path) -> tuple[dict[str, str], int]:
    """Fields up to ElementDataFile, which is the last, and the length of the header in bytes."""
    fields: dict[str, str] = {}
    with path.open("rb") as file:
        while "ElementDataFile" not in fields:
            line = file.readline(LONGEST_LINE)
            key, equals, value = line.decode("utf-8", "surrogateescape").partition("=")
            if not line or (not equals and key.strip()) or len(fields) == MOST_FIELDS:
                raise ArgumentError("expected a MetaImage file, found no ElementDataFile in its header")
            fields[key.strip()] = value.strip()
        return fields, file.tell()


def _stored_type(fields: dict[str, str]) -> np.dtype:
    """Sample type with byte order."""
    name = fields["ElementType"]
    if name not in TYPES:
        raise ArgumentError(f"ElementType: expected one of {', '.join(TYPES)}, got {name}")
    msb = fields.get("BinaryDataByteOrderMSB", fields.get("ElementByteOrderMSB", "False"))
    return np.dtype(TYPES[name]).newbyteorder(">" if msb.lower() == "true" else "<")


def _triple(fields: dict[str, str], keys: tuple[str, ...], default: float) -> Triple:
    """Three numbers of the first key that is there."""
    text = next((fields[key] for key in keys if key in fields), None)
    x, y, z = (float(number) for number in text.split()) if text else (default,) * 3
    return x, y, z


def _directions(fields: dict[str, str]) -> np.ndarray:
    """Directions of the axes in the rows of [3, 3]."""
    text = next(
        (fields[key] for key in ("TransformMatrix", "Rotation", "Orientation") if key in fields), None
    )
    numbers = [float(number) for number in text.split()] if text else np.eye(3)
    return np.reshape(numbers, (3, 3))


def _data_file(path: Path, fields: dict[str, str], header_size: int, n_bytes: int) -> tuple[Path, int]:
    """File with the samples and where they start in it."""
    name = fields["ElementDataFile"]
    if name == "LOCAL":
        return path, header_size
    if name.startswith("LIST") or "%" in name:
        raise ArgumentError("expected one file of samples, got one per slice; convert it to .mha")
    data = named_file("ElementDataFile", path.parent, name)
    if not data.is_file():
        raise ArgumentError(f"no such file with samples: {data}")
    skip = int(fields.get("HeaderSize", "0"))
    return data, skip if skip >= 0 else data.stat().st_size - n_bytes  # -1: samples end the file
