"""NRRD files: any as a source, and the canonical file of a prepared volume, mapped into memory."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from io import BytesIO
from math import isnan, prod
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from texgs.core.errors import ArgumentError, ShapeError
from texgs.core.names import named_file
from texgs.core.reading import reading_as
from texgs.volume.grid import Dims, Grid, Triple, byte_count, check_lattice
from texgs.volume.oriented import ONES, ZEROS, oriented
from texgs.volume.packed import bzip2, deflated, unpacked
from texgs.volume.slabs import ArraySource, RawSource, Source

LEFT_HANDED = ("left-anterior-superior", "las", "3d-left-handed")
SCALAR = ("domain", "space", "time", "scalar", "stub", "none", "???")  # kinds of axes that hold no components
LONGEST_HEADER = 1 << 20  # bytes
# Encodings by the words that NRRD has for them.
UNPACK = {"gzip": deflated, "gz": deflated, "bzip2": bzip2, "bz2": bzip2}
TEXT = ("ascii", "ASCII", "text", "txt")
ALIGNMENT = 64  # bytes; where the samples of a canonical file start: cache lines, and any vector type
# NRRD has many words for a type; sizes and signs are what they are in C on every machine of today.
TYPES = {
    "int8": ("signed char", "int8", "int8_t"),
    "uint8": ("uchar", "unsigned char", "uint8", "uint8_t"),
    "int16": ("short", "short int", "signed short", "signed short int", "int16", "int16_t"),
    "uint16": ("ushort", "unsigned short", "unsigned short int", "uint16", "uint16_t"),
    "int32": ("int", "signed int", "int32", "int32_t"),
    "uint32": ("uint", "unsigned int", "uint32", "uint32_t"),
    "int64": (
        "longlong",
        "long long",
        "long long int",
        "signed long long",
        "signed long long int",
        "int64",
        "int64_t",
    ),
    "uint64": ("ulonglong", "unsigned long long", "unsigned long long int", "uint64", "uint64_t"),
    "float32": ("float",),
    "float64": ("double",),
}


@dataclass(frozen=True)
class Header:
    """What an NRRD header says about a scalar volume."""

    fields: dict[str, Any]  # as parsed by pynrrd
    data: Path  # file with the samples
    offset: int  # bytes before the samples, as they are stored
    dims: Dims
    stored: np.dtype
    spacing: Triple
    origin: Triple


def open_nrrd(path: Path, spacing: Triple | None, origin: Triple | None) -> Source:
    """Samples are read on demand, or as a whole where they are compressed or text.

    Space directions give the spacing, and axes are turned to the closest ones of space.

    Raises:
        ArgumentError: if the file is damaged or no scalar volume.
    """
    header = _read_header(path)
    lattice = (ONES if spacing else header.spacing, ZEROS if origin else header.origin)
    turned = partial(
        oriented,
        directions=header.fields.get("space directions", np.eye(3)),
        spacing=spacing,
        origin=origin,
        is_left_handed=str(header.fields.get("space")).lower() in LEFT_HANDED,
    )
    if header.fields["encoding"] == "raw":
        return turned(RawSource(header.data, header.dims, header.stored, header.offset, *lattice))
    check_lattice(header.dims, header.stored, *lattice)
    with reading_as("an NRRD file"):
        return turned(ArraySource(Grid(_decoded(header), *lattice), path.name))


def open_grid(path: str | Path) -> Grid:
    """Map a prepared volume into memory; samples are read when they are used.

    Args:
        path: .nrrd or .nhdr with raw encoding.

    Raises:
        ArgumentError, ShapeError: if the file is missing, cut off, or not such a volume.
    """
    path = Path(path)
    if not path.is_file():
        raise ArgumentError(f"{path}: no such file; prepare the volume first")
    try:
        header = _read_header(path)
        encoding = header.fields["encoding"]
        if encoding != "raw":
            raise ArgumentError(f"expected a prepared volume with raw encoding, got {encoding}; prepare it")
        source = RawSource(
            header.data, header.dims, header.stored, header.offset, header.spacing, header.origin
        )
    except (ArgumentError, ShapeError) as error:
        raise type(error)(f"{path}: {error}") from error
    values = np.memmap(source.path, source.stored, "r", source.offset, source.dims[::-1])
    return Grid(values, source.spacing, source.origin)


def write_header(file: BinaryIO, dims: Dims, dtype: np.dtype, spacing: Triple, origin: Triple) -> int:
    """Write the header of a canonical file: raw samples follow, little endian.

    Args:
        file: at its start.
        dims: samples along x, y, z.
        dtype: one of those in `TYPES`.
        spacing: x, y, z, physical units.
        origin: x, y, z, physical units.

    Returns:
        Length of the header in bytes, a multiple of `ALIGNMENT`.
    """
    dx, dy, dz = spacing
    directions = " ".join(_vector(step) for step in ((dx, 0, 0), (0, dy, 0), (0, 0, dz)))
    lines = [
        "NRRD0004",
        f"type: {TYPES[dtype.name][0]}",
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
    """Numbers as NRRD writes a vector, exact to the last bit."""
    return "(" + ",".join(repr(float(number)) for number in numbers) + ")"


def _read_header(path: Path) -> Header:
    """Parse a header, attached or detached.

    Raises:
        ArgumentError: if it is no header of a scalar volume.
    """
    import nrrd

    with reading_as("an NRRD file"), path.open("rb") as file:
        if file.read(4) != b"NRRD":  # a foreign file may hold no line break for gigabytes
            raise ArgumentError("expected an NRRD file, but it does not start with NRRD")
        file.seek(0)
        head = BytesIO(file.read(LONGEST_HEADER))
        fields = nrrd.read_header(head)
        end = head.tell()
        if end == LONGEST_HEADER:
            raise ArgumentError(f"expected a header of at most {LONGEST_HEADER} bytes, got a longer one")
        dims = _dims(fields)
        stored = _stored_type(fields)
        data, offset = _data_file(path, fields, end, byte_count(dims, stored))
        return Header(fields, data, offset, dims, stored, _spacing(fields), _origin(fields))


def _decoded(header: Header) -> np.ndarray:
    """Samples [Z, Y, X] of a file that is compressed or text; NRRD skips bytes after decompression."""
    encoding, skip = header.fields["encoding"], _number(header.fields, "byte skip")
    if encoding in UNPACK:
        return unpacked(header.data, header.offset, header.dims, header.stored, UNPACK[encoding], skip)
    if encoding not in TEXT:
        raise ArgumentError(f"encoding: expected raw, gzip, bzip2 or ascii, got {encoding}")
    with header.data.open("rb") as file:
        file.seek(header.offset + max(0, skip))
        values = np.fromfile(file, header.stored, sep=" ")
    if values.size != prod(header.dims):
        raise ArgumentError(f"expected {prod(header.dims)} samples, found {values.size}; is it cut off?")
    return values.reshape(header.dims[::-1])


def _dims(fields: dict[str, Any]) -> Dims:
    """Samples along x, y, z."""
    sizes = tuple(int(size) for size in fields["sizes"])
    kinds = fields.get("kinds", [])
    if kinds and kinds[0] not in SCALAR:
        raise ArgumentError(f"expected a scalar volume, got {sizes[0]} components per sample")
    if len(sizes) != 3:
        raise ArgumentError(f"expected 3 axes, got {len(sizes)}: sizes {list(sizes)}")
    return sizes[0], sizes[1], sizes[2]


def _stored_type(fields: dict[str, Any]) -> np.dtype:
    """Sample type with byte order."""
    name = fields["type"]
    word = next((ours for ours, theirs in TYPES.items() if name in theirs), None)
    if word is None:
        raise ArgumentError(f"type: expected integers or floats, got {name}")
    return np.dtype(word).newbyteorder(">" if fields.get("endian") == "big" else "<")


def _data_file(path: Path, fields: dict[str, Any], end: int, n_bytes: int) -> tuple[Path, int]:
    """File with the samples and where they start in it."""
    name = fields.get("data file", fields.get("datafile"))
    byte_skip = _number(fields, "byte skip")
    if name is None:
        data, start = path, end
    elif name.startswith("LIST") or "%" in name:
        raise ArgumentError("expected one file of samples, got several; join them with `unu join`")
    else:
        data, start = named_file("data file", path.parent, name), 0
    if not data.is_file():
        raise ArgumentError(f"no such file with samples: {data}")
    is_raw = fields["encoding"] == "raw"
    if is_raw and byte_skip == -1:
        return data, data.stat().st_size - n_bytes  # the samples end the file
    with data.open("rb") as file:
        file.seek(start)
        for _ in range(_number(fields, "line skip")):
            if not file.readline():
                raise ArgumentError("line skip: expected no more lines than the file has")
        return data, file.tell() + (byte_skip if is_raw else 0)


def _number(fields: dict[str, Any], key: str) -> int:
    """How much to skip; both keys are also written without the space."""
    return int(fields.get(key, fields.get(key.replace(" ", ""), 0)))


def _spacing(fields: dict[str, Any]) -> Triple:
    """Lengths of the space directions, the spacings, or by the ends of the axes; 1 where nothing is said."""
    directions = fields.get("space directions")
    if directions is not None:
        steps = np.linalg.norm(directions, axis=1)
    else:
        steps = fields.get("spacings", _steps(fields))
    x, y, z = (1.0 if isnan(step) else float(step) for step in steps)
    return x, y, z


def _steps(fields: dict[str, Any]) -> list[float]:
    """Distances of samples by the ends of their axes: places of the first and last, or edges of cells."""
    nothing = [float("nan")] * 3
    low = fields.get("axis mins", fields.get("axismins", nothing))
    high = fields.get("axis maxs", fields.get("axismaxs", nothing))
    said = fields.get("centerings", fields.get("centers", "node node node"))
    centers = said.split() if isinstance(said, str) else said
    gaps = [
        size - (0 if center == "cell" else 1) for size, center in zip(fields["sizes"], centers, strict=True)
    ]
    return [abs(b - a) / gap if gap else 1.0 for a, b, gap in zip(low, high, gaps, strict=True)]


def _origin(fields: dict[str, Any]) -> Triple:
    """Place of the first sample; 0 where nothing is said."""
    start = fields.get("space origin", fields.get("axis mins", fields.get("axismins", [0.0] * 3)))
    x, y, z = (0.0 if isnan(place) else float(place) for place in start)
    return x, y, z
