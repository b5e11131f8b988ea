"""Samples in a compressed stream or as text, read as far as the header says and no further.

Not by ITK: it takes a stream that ends too early for whole and fills up with zeros, and skips words.
"""

from __future__ import annotations

import bz2
import gzip
import zlib
from math import prod
from typing import BinaryIO

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.volume.grid import Dims, byte_count, require_room
from texgs.volume.headers import StoredSamples


def unpacked(stored: StoredSamples, dims: Dims, dtype: np.dtype) -> np.ndarray:
    """Unpack samples [Z, Y, X].

    Args:
        stored: where and how they are.
        dims: samples along x, y, z.
        dtype: sample type with byte order.
    """
    if stored.encoding == "text":
        return _from_text(stored, dims, dtype)
    n_bytes = byte_count(dims, dtype)
    # The stream is in memory beside what it unpacks to, which is copied once from the library's own blocks.
    require_room(dims, dtype, stored.path.stat().st_size - stored.offset + n_bytes)
    # One byte more than there should be makes the library go to the end of its stream, and compare checksums.
    most = 2 * n_bytes if stored.skip == -1 else n_bytes + stored.skip + 1
    with stored.path.open("rb") as file:
        file.seek(stored.offset)
        samples = _unpack(file, stored.encoding, most)
    start = len(samples) - n_bytes if stored.skip == -1 else stored.skip
    if start < 0 or len(samples) != start + n_bytes:
        more = "at least " if len(samples) == most else ""
        raise ArgumentError(
            f"the file is cut off, or its header another's: expected {n_bytes} bytes of samples, found "
            f"{more}{len(samples)}"
        )
    return np.frombuffer(samples, dtype, prod(dims), start).reshape(dims[::-1])


def _from_text(stored: StoredSamples, dims: Dims, dtype: np.dtype) -> np.ndarray:
    """Read samples [Z, Y, X] that are words."""
    require_room(dims, dtype)
    with stored.path.open("rb") as file:
        file.seek(stored.offset + max(0, stored.skip))
        values = np.fromfile(file, dtype, sep=" ")
    if values.size != prod(dims):
        raise ArgumentError(f"expected {prod(dims)} samples, found {values.size}; is it cut off?")
    return values.reshape(dims[::-1])


def _unpack(file: BinaryIO, encoding: str, most: int) -> bytes:
    """Read a stream, or several behind each other, as programs write them that use several cores."""
    if encoding == "zlib":
        return zlib.decompressobj().decompress(file.read(), most)
    with gzip.GzipFile(fileobj=file) if encoding == "gzip" else bz2.BZ2File(file) as stream:
        return stream.read(most)
