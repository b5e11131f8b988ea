"""Vertices of PLY files, whose headers are checked before anything is read."""

import contextlib
import re
from pathlib import Path

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.core.io import reading

LONGEST_HEADER = 1 << 16  # bytes
MAGIC = b"ply"
PROPERTY = re.compile(rb"^property[ \t]+\S+[ \t]+(\w+)", re.MULTILINE)
ELEMENT = re.compile(rb"^element[ \t]+\S+[ \t]+(\d+)", re.MULTILINE)


def read_vertices(path: str | Path) -> np.ndarray:
    """Return the vertices of a PLY file as a structured array [N]."""
    from plyfile import PlyData

    with reading(path, "a whole PLY file") as path:
        _check_counts(path)
        data = PlyData.read(path)
        if "vertex" not in data:
            elements = ", ".join(element.name for element in data) or "nothing"
            raise ArgumentError(f"{path}: expected vertices, got {elements}")
        vertices: np.ndarray = data["vertex"].data
        return vertices


def is_ply(path: Path) -> bool:
    """Return whether a file begins as PLY files do."""
    with contextlib.suppress(OSError), path.open("rb") as file:
        return file.read(len(MAGIC)) == MAGIC
    return False


def properties(path: Path) -> set[str]:
    """Return the names of the properties that the header of a PLY file has."""
    return {name.decode() for name in PROPERTY.findall(_header(path))}


def _header(path: Path) -> bytes:
    """Return the start of a PLY file up to its last line of the header."""
    with path.open("rb") as file:
        return file.read(LONGEST_HEADER).partition(b"end_header")[0]


def _check_counts(path: Path) -> None:
    """Refuse a header that claims more elements than the file has bytes: they would have memory first."""
    header = _header(path)
    size = path.stat().st_size
    for count in ELEMENT.findall(header):
        if len(count) > 18 or int(count) > size:
            raise ArgumentError(
                f"{path}: expected a whole PLY file, got a header of {count[:18].decode()} elements and "
                f"{size} bytes in all; is it cut off?"
            )
