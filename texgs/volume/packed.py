"""Samples in a compressed stream, unpacked as far as the header says and no further."""

from __future__ import annotations

import bz2
import zlib
from collections.abc import Callable, Iterator
from functools import partial
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.volume.grid import Dims, byte_count, require_room

ZLIB_OR_GZIP = 47  # window bits: the largest window, header found by zlib
Unpack = Callable[[bytes, int], bytes]  # of a stream, and how much of it at most


def deflated(packed: bytes, most: int) -> bytes:
    """Bytes of zlib or gzip streams, one behind the other."""
    return b"".join(streams(packed, most, partial(zlib.decompressobj, ZLIB_OR_GZIP)))


def bzip2(packed: bytes, most: int) -> bytes:
    """Bytes of bzip2 streams, one behind the other."""
    return b"".join(streams(packed, most, bz2.BZ2Decompressor))


def streams(packed: bytes, most: int, start: Callable[[], Any]) -> Iterator[bytes]:
    """Bytes of each stream: programs that pack on several cores write many."""
    magic = packed[:2]
    while most > 0 and packed and packed.startswith(magic):
        stream = start()
        part = stream.decompress(packed, most)
        yield part
        packed, most = stream.unused_data, most - len(part)


def unpacked(
    path: Path, offset: int, dims: Dims, stored: np.dtype, unpack: Unpack = deflated, skip: int = 0
) -> np.ndarray:
    """Samples [Z, Y, X] of a stream in a file.

    Args:
        path: of the file.
        offset: of the stream, bytes.
        dims: samples along x, y, z.
        stored: sample type with byte order.
        unpack: what reads the stream.
        skip: bytes of the stream before the samples; -1: they end it.

    Raises:
        ArgumentError: if the stream is shorter or longer.
        OutOfMemoryError: if the samples do not fit into memory.
    """
    n_bytes = byte_count(dims, stored)
    # The stream is in memory beside what it unpacks to, which zlib and bzip2 copy once from their own blocks.
    require_room(dims, stored, path.stat().st_size - offset + n_bytes)
    with path.open("rb") as file:
        file.seek(offset)
        # One byte more than there should be makes zlib go to the end of its stream, and compare its checksum.
        most = 2 * n_bytes if skip == -1 else n_bytes + skip + 1
        samples = unpack(file.read(), most)
    start = len(samples) - n_bytes if skip == -1 else skip
    if start < 0 or len(samples) != start + n_bytes:
        more = "at least " if len(samples) == most else ""
        raise ArgumentError(
            f"the file is cut off, or its header another's: expected {n_bytes} bytes of samples, found "
            f"{more}{len(samples)}"
        )
    return np.frombuffer(samples, stored, prod(dims), start).reshape(dims[::-1])
