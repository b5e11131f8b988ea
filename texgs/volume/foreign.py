"""Formats that SimpleITK or PyVista reads, as sources; they do it in a process of their own.

Damaged files crash libraries that are written in C++, and make them print instead of raising.
"""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from threading import Timer
from typing import IO, Any

import numpy as np

from texgs.core.errors import ArgumentError, OutOfMemoryError
from texgs.core.io import reading_as
from texgs.volume import foreign_reader  # imported here, so that it counts as code of a job
from texgs.volume.grid import Grid, Triple, byte_count, require_room
from texgs.volume.headers import METAIMAGE, NRRD, StoredSamples, stored_samples
from texgs.volume.orientation import AS_STORED, closest, permuted_values
from texgs.volume.packed import unpacked
from texgs.volume.slabs import ArraySource, RawSource, Source

TAIL = 1024  # bytes; more than the end tag and whatever blanks an editor left behind it
SECONDS, RATE = 60.0, 1e6  # how long reading may take: at least, and bytes per second of a large file
LONGEST_LINE = 1 << 20  # bytes of what the process says before the samples


def open_foreign(
    path: Path, spacing: Triple | None, origin: Triple | None, series: str | None = None
) -> Source:
    """Open image data with its axes along the closest ones of space, so that nothing is mirrored.

    Samples that are stored as in memory are read on demand, all others as a whole.

    Args:
        path: of the file, or of a folder of DICOM slices.
        spacing: replaces that of the result.
        origin: replaces that of the result.
        series: of several in a folder, its number or UID.
    """
    suffix = path.suffix.lower()
    what = "a folder of DICOM slices" if path.is_dir() else f"a {suffix} file"
    with reading_as(what):
        if suffix == ".vti":
            _check_end(path)
        stored = stored_samples(path) if suffix in (*NRRD, *METAIMAGE) else None
        said, values = _ask(path, what, series, is_header_only=stored is not None)
        axes = closest(np.array(said["directions"]))
        dx, dy, dz = spacing or (said["spacing"][axis] for axis, _ in axes)
        lengths = [
            (said["dims"][axis] - 1) * step for (axis, _), step in zip(axes, (dx, dy, dz), strict=True)
        ]
        x, y, z = origin or (
            place - (0.0 if sign > 0 else length)
            for place, (_, sign), length in zip(said["origin"], axes, lengths, strict=True)
        )
        if stored is not None and stored.encoding == "raw":
            source = _raw_source(stored, said)
            if axes == AS_STORED:
                return replace(source, spacing=(dx, dy, dz), origin=(x, y, z))
            values = np.memmap(source.path, source.stored, "r", source.offset, source.dims[::-1])
        elif stored is not None:
            values = unpacked(stored, said["dims"], _dtype(stored, said))
        return ArraySource(Grid(permuted_values(values, axes), (dx, dy, dz), (x, y, z)), path.name)


def _dtype(stored: StoredSamples, said: dict[str, Any]) -> np.dtype:
    """Sample type with byte order."""
    return np.dtype(said["dtype"]).newbyteorder(">" if stored.is_big_endian else "<")


def _raw_source(stored: StoredSamples, said: dict[str, Any]) -> RawSource:
    """Samples as they are in the file, of spacing 1."""
    dims, dtype = (said["dims"][0], said["dims"][1], said["dims"][2]), _dtype(stored, said)
    offset = stored.offset if stored.offset >= 0 else stored.path.stat().st_size - byte_count(dims, dtype)
    return RawSource(stored.path, dims, dtype, offset)


def _check_end(path: Path) -> None:
    """Refuse an XML file that is cut off: VTK reads uncompressed samples past its end without a word."""
    with path.open("rb") as file:
        file.seek(max(0, path.stat().st_size - TAIL))
        if b"</VTKFile>" not in file.read():
            raise ArgumentError("the file is cut off or no .vti file: expected </VTKFile> at its end")


def _ask(
    path: Path, what: str, series: str | None, is_header_only: bool
) -> tuple[dict[str, Any], np.ndarray]:
    """Let a process of its own read a file: what it says, and the samples [Z, Y, X]."""
    request = json.dumps({"path": str(path.absolute()), "series": series, "is_header_only": is_header_only})
    command = [sys.executable, "-P", "-m", foreign_reader.__name__, request]
    pipes = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
    with subprocess.Popen(command, **pipes) as child:  # type: ignore[call-overload]
        watchdog = Timer(SECONDS + _size(path) / RATE, child.kill)
        watchdog.start()
        try:
            said, values = _received(child.stdout)
        finally:
            watchdog.cancel()
            child.kill()
    if said is None:
        raise ArgumentError(
            f"expected {what}, but its reader broke off; it is damaged, or claims more memory than there is"
        )
    if "error" in said:
        raise (OutOfMemoryError if said["is_memory"] else ArgumentError)(said["error"])
    return said, values


def _size(path: Path) -> int:
    """Bytes of a file, or of all files of a folder."""
    return sum(each.stat().st_size for each in path.iterdir()) if path.is_dir() else path.stat().st_size


def _received(stream: IO[bytes]) -> tuple[dict[str, Any] | None, np.ndarray]:
    """What the process says about a volume, None if it died, and the samples, none where it sends none."""
    said, values = json.loads(stream.readline(LONGEST_LINE) or "null"), np.empty(0)
    if said is None or "error" in said or said["is_header_only"]:
        return said, values
    dims, dtype = said["dims"], np.dtype(said["dtype"])
    require_room(dims, dtype)
    values = np.empty(dims[::-1], dtype)
    rest = memoryview(values.data).cast("B")
    while len(rest):
        count = stream.readinto(rest)  # type: ignore[attr-defined]
        if not count:
            return None, values
        rest = rest[count:]
    return said, values
