"""MetaImage volumes (.mha, or .mhd with a file of samples beside it) as sources."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.core.names import named_file
from texgs.core.reading import reading_as
from texgs.volume.grid import Grid, Triple, byte_count, check_lattice
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

    The direction matrix is not applied: axes stay as they are stored.

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
        spacing = spacing or _triple(fields, ("ElementSpacing", "ElementSize"), 1.0)
        origin = origin or _triple(fields, ("Offset", "Position", "Origin"), 0.0)
        check_lattice(dims, stored, spacing, origin)
        data, offset = _data_file(path, fields, header_size, byte_count(dims, stored))
        if fields.get("CompressedData", "False").lower() == "true":
            values = unpacked(data, offset, dims, stored)
            return ArraySource(Grid(values, spacing, origin), path.name)
    return RawSource(data, dims, stored, offset, spacing, origin)


def _read_fields(path: Path) -> tuple[dict[str, str], int]:
    """Fields up to ElementDataFile, which is the last, and the length of the header in bytes."""
    fields: dict[str, str] = {}
    with path.open("rb") as file:
        while "ElementDataFile" not in fields:
            line = file.readline(LONGEST_LINE)
            key, equals, value = line.decode("ascii").partition("=")
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
