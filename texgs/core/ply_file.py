"""Vertices of PLY files, in text or either byte order; headers are checked before anything is read."""

import contextlib
import re
from dataclasses import dataclass, field
from itertools import takewhile
from pathlib import Path
from typing import Literal

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.core.io import reading

MAX_HEADER_BYTES = 1 << 16
MAGIC = b"ply"
PROPERTY = re.compile(rb"^property[ \t]+\S+[ \t]+(\w+)", re.MULTILINE)
END = re.compile(rb"^end_header[ \t]*\r?\n", re.MULTILINE)
Order = Literal["", "<", ">"]
ORDERS: dict[str, Order] = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
TYPES = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"}
TYPES |= {"float": "f4", "double": "f8"}
TYPES |= {np.dtype(code).name: code for code in TYPES.values()}


@dataclass(frozen=True)
class Element:
    """What the header says of an element."""

    name: str
    count: int
    columns: list[tuple[str, str]] = field(default_factory=list)  # name and type of each number
    lists: list[str] = field(default_factory=list)  # names of properties that are lists


def read_vertices(path: str | Path) -> np.ndarray:
    """Return the vertices of a PLY file as a structured array [N]. What follows them is not read."""
    with reading(path, "a whole PLY file") as path:
        order, elements, start = _read_header(path)
        before = [*takewhile(lambda element: element.name != "vertex", elements)]
        if len(before) == len(elements):
            names = ", ".join(element.name for element in elements) or "nothing"
            raise ArgumentError(f"{path}: expected vertices, got {names}")
        vertex = elements[len(before)]
        if vertex.lists:
            raise ArgumentError(f"{path}: expected vertices with a number {vertex.lists[0]} each, got lists")
        vertices = _text(path, vertex, before) if not order else _binary(path, vertex, before, order, start)
        if len(vertices) < vertex.count:
            raise ValueError(f"{len(vertices)} of {vertex.count} vertices")
        return vertices


def _text(path: Path, vertex: Element, before: list[Element]) -> np.ndarray:
    """Return the vertices of a file in text."""
    with path.open(encoding="latin-1") as file:
        for line in file:
            if line.strip() == "end_header":
                break
        for _ in range(sum(element.count for element in before)):
            next(file)
        lines = (line for line, _ in zip(file, range(vertex.count), strict=False))
        if not vertex.count:
            return np.empty(0, vertex.columns)
        return np.loadtxt(lines, vertex.columns, comments=None, ndmin=1)


def _binary(
    path: Path, vertex: Element, before: list[Element], order: Literal["<", ">"], start: int
) -> np.ndarray:
    """Return the vertices of a binary file, whose elements begin at a byte, in this machine's byte order."""
    for element in before:
        if element.lists:
            raise ValueError(f"lists of {element.name} before the vertices")
        start += element.count * np.dtype(element.columns).itemsize
    stored = np.dtype(vertex.columns).newbyteorder(order)
    return np.fromfile(path, stored, vertex.count, offset=start).astype(stored.newbyteorder("="))


def _read_header(path: Path) -> tuple[Order, list[Element], int]:
    """Return the byte order, "" for text, the elements, and the byte at which they begin.

    A header that claims more elements than the file has bytes is refused: they would have memory first.
    """
    header, size = _header(path), path.stat().st_size
    end, elements = END.search(header), list[Element]()
    order: Order | None = None
    if not header.startswith(MAGIC) or end is None:
        raise ValueError("no whole header")
    for line in header[: end.start()].decode("latin-1").splitlines()[1:]:
        match line.split():
            case ["format", kind, "1.0"] if kind in ORDERS:
                order = ORDERS[kind]
            case ["element", name, count] if count.isdecimal() and len(count) < 19 and int(count) <= size:
                elements.append(Element(name, int(count)))
            case ["element", *_]:
                raise ValueError(f"a header with the line {line[:60]!r} and {size} bytes in all")
            case ["property", "list", _, _, name] if elements:
                elements[-1].lists.append(name)
            case ["property", kind, name] if elements and kind in TYPES:
                elements[-1].columns.append((name, TYPES[kind]))
            case [] | ["comment" | "obj_info", *_]:
                pass
            case _:
                raise ValueError(f"a header with the line {line[:60]!r}")
    if order is None:
        raise ValueError("a header without a format")
    return order, elements, end.end()


def is_ply(path: Path) -> bool:
    """Return whether a file begins as PLY files do."""
    with contextlib.suppress(OSError), path.open("rb") as file:
        return file.read(len(MAGIC)) == MAGIC
    return False


def properties(path: Path) -> set[str]:
    """Return the names of the properties that the header of a PLY file has."""
    return {name.decode() for name in PROPERTY.findall(_header(path).partition(b"end_header")[0])}


def _header(path: Path) -> bytes:
    """Return the start of a file, in which the header of a PLY file is."""
    with path.open("rb") as file:
        return file.read(MAX_HEADER_BYTES)
