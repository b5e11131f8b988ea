"""Samples of NRRD and MetaImage files: where they are, and how to unpack them.

ITK only reads their headers: it takes a stream that ends too early for whole and fills up with zeros, skips
words, and reads no slabs.
"""

import bz2
import gzip
import zlib
from math import prod
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.volume.grid import Dims, byte_count, require_room
from texgs.volume.headers import METAIMAGE, read_fields, require_itself, samples_file

NUMBERS = ("elementspacing", "elementsize", "offset", "position", "origin", "transformmatrix", "rotation")
ENCODINGS = {"raw": "raw", "gzip": "gzip", "gz": "gzip", "bzip2": "bzip2", "bz2": "bzip2"} | dict.fromkeys(
    ("ascii", "ASCII", "text", "txt"), "text"
)  # by NRRD's words


class StoredSamples(NamedTuple):
    """Samples in a file."""

    path: Path
    offset: int  # bytes before them as they are stored; -1: they end the file
    skip: int  # bytes before them after decompression; -1: they end the stream
    encoding: str  # raw, zlib, gzip, bzip2 or text
    is_big_endian: bool


def stored_samples(path: Path) -> StoredSamples | None:
    """Find the samples of a header, or None for MetaImage's text."""
    fields, end = read_fields(path)
    samples = samples_file(path, fields)
    if not samples.is_file():
        raise ArgumentError(f"no such file with samples: {samples}")
    require_itself(samples)
    offset = end if samples == path else 0
    if path.suffix.lower() in METAIMAGE:
        for name in NUMBERS:  # ITK reads 1 for words that are no numbers
            _ = [float(word) for word in fields.get(name, "").split()]
        is_big = _is_true(fields, "binarydatabyteordermsb") or _is_true(fields, "elementbyteordermsb")
        offset = int(fields.get("headersize", "0")) or offset
        encoding = "zlib" if _is_true(fields, "compresseddata") else "raw"
        is_text = "binarydata" in fields and not _is_true(fields, "binarydata")
        return None if is_text else StoredSamples(samples, offset, 0, encoding, is_big)
    encoding = ENCODINGS.get(fields["encoding"], "")
    if not encoding:
        raise ArgumentError(f"encoding: expected raw, gzip, bzip2 or ascii, got {fields['encoding']}")
    skip = int(fields.get("byteskip", "0"))
    with samples.open("rb") as file:
        file.seek(offset)
        for _ in range(int(fields.get("lineskip", "0"))):
            if not file.readline():
                raise ArgumentError("line skip: expected no more lines than the file has")
        offset = file.tell()
    if encoding == "raw":
        offset, skip = -1 if skip == -1 else offset + skip, 0
    return StoredSamples(samples, offset, skip, encoding, fields.get("endian") == "big")


def _is_true(fields: dict[str, str], name: str) -> bool:
    """Return whether a field of MetaImage says yes."""
    return fields.get(name, "").lower() in ("true", "1")


def unpack(stored: StoredSamples, dims: Dims, dtype: np.dtype) -> np.ndarray:
    """Unpack samples [Z, Y, X] of a type with byte order, as far as the header says and no further."""
    n_bytes = byte_count(dims, dtype)
    if stored.encoding == "text":
        # A narrow type would wrap numbers that it cannot hold.
        wide = dtype if dtype.kind == "f" or dtype.itemsize == 8 else np.dtype(np.int64)
        require_room(dims, wide, n_bytes)
        with stored.path.open("rb") as file:
            file.seek(stored.offset + max(0, stored.skip))
            values = np.fromfile(file, wide, sep=" ")
        if values.size != prod(dims):
            raise ArgumentError(f"expected {prod(dims)} samples, found {values.size}; is it cut off?")
        stored_as = values.astype(dtype)
        if dtype.kind != "f" and (wrong := stored_as != values).any():
            got = values[wrong][0]
            raise ArgumentError(f"expected samples of {dtype.name}, got {got}; is the header another's?")
        return stored_as.reshape(dims[::-1])
    # The stream, the library's blocks and the unpacked copy are in memory at once.
    require_room(dims, dtype, stored.path.stat().st_size - stored.offset + n_bytes)
    # Asking for one byte too many makes the library reach the end of the stream and compare checksums.
    most = 2 * n_bytes if stored.skip == -1 else n_bytes + stored.skip + 1
    with stored.path.open("rb") as file:
        file.seek(stored.offset)
        samples = _read_stream(file, stored.encoding, most)
    start = len(samples) - n_bytes if stored.skip == -1 else stored.skip
    if start < 0 or len(samples) != start + n_bytes:
        more = "at least " if len(samples) == most else ""
        raise ArgumentError(
            f"the file is cut off, or its header another's: expected {n_bytes} bytes of samples, found "
            f"{more}{len(samples)}"
        )
    return np.frombuffer(samples, dtype, prod(dims), start).reshape(dims[::-1])


def _read_stream(file: BinaryIO, encoding: str, most: int) -> bytes:
    """Read a stream, or several in a row, as parallel packers write them."""
    if encoding == "zlib":
        return zlib.decompressobj().decompress(file.read(), most)
    with gzip.GzipFile(fileobj=file) if encoding == "gzip" else bz2.BZ2File(file) as stream:
        return stream.read(most)
