"""VTK's own formats as sources, read as a whole by VTK in a process of its own.

VTK ends its process where a damaged header claims more memory than there is.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from threading import Timer
from typing import IO, Any

import numpy as np

from texgs.core.errors import ArgumentError, OutOfMemoryError
from texgs.core.reading import reading_as
from texgs.volume.grid import Grid, Triple, require_room
from texgs.volume.oriented import ONES, ZEROS, oriented
from texgs.volume.slabs import ArraySource, Source

TAIL = 1024  # bytes; more than the end tag and whatever blanks an editor left behind it
SECONDS, RATE = 60.0, 1e6  # how long VTK may take: at least, and bytes per second of a large file
LONGEST_LINE = 1 << 16  # bytes of what the process says before the samples


def open_vtk(path: Path, spacing: Triple | None, origin: Triple | None) -> Source:
    """Image data with its scalars, or its first point array where none are marked as such.

    Axes are turned to the closest ones of space.

    Raises:
        ArgumentError: if the file is damaged, or holds another kind of data set or no scalar field.
        OutOfMemoryError: if its samples do not fit into memory.
    """
    _check_end(path)
    command = [sys.executable, "-P", "-m", "texgs.volume.vtk_reader", str(path.absolute())]
    pipes = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
    with subprocess.Popen(command, **pipes) as child:  # type: ignore[call-overload]
        watchdog = Timer(SECONDS + path.stat().st_size / RATE, child.kill)
        watchdog.start()
        try:
            with reading_as(f"a {path.suffix} file"):
                said, values = _received(child.stdout)
        finally:
            watchdog.cancel()
            child.kill()
    if said is None:
        raise ArgumentError(
            f"expected a {path.suffix} file, but VTK broke off; it is damaged, or claims more memory than "
            "there is"
        )
    if "error" in said:
        raise (OutOfMemoryError if said["is_memory"] else ArgumentError)(said["error"])
    (dx, dy, dz), (x, y, z) = said["spacing"], said["origin"]
    lattice = (ONES if spacing else (dx, dy, dz), ZEROS if origin else (x, y, z))
    stored = ArraySource(Grid(values, *lattice), path.name)
    return oriented(stored, said["directions"], spacing, origin)


def _received(stream: IO[bytes]) -> tuple[dict[str, Any] | None, np.ndarray]:
    """What the process says about a volume, None if it died, and the samples [Z, Y, X]."""
    said, values = json.loads(stream.readline(LONGEST_LINE) or "null"), np.empty(0)
    if said is None or "error" in said:
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


def _check_end(path: Path) -> None:
    """Refuse an XML file that is cut off: VTK reads uncompressed samples past its end without a word."""
    if path.suffix.lower() != ".vti":
        return
    with path.open("rb") as file:
        file.seek(max(0, path.stat().st_size - TAIL))
        if b"</VTKFile>" not in file.read():
            raise ArgumentError("the file is cut off or no .vti file: expected </VTKFile> at its end")
