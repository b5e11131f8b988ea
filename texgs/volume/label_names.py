"""Names and colours of labels, from where people keep them."""

import os
import re
from collections.abc import Container, Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import numpy as np

from texgs.core.errors import ArgumentError, errors_at
from texgs.core.io import reading_as
from texgs.volume.headers import NRRD, read_fields

SEGMENT = re.compile(r"segment(\d+)_name=")  # there may be gaps between numbers
SEGMENTATION = ".seg.nrrd"  # of 3D Slicer; its header names segments
TABLES = (".label", ".ctbl", ".txt")  # suffixes of tables beside a file of labels
FREESURFER = (".mgz", ".mgh")
# Of ITK-SNAP: number r g b a visible mesh "name"; of FreeSurfer and 3D Slicer: number name r g b a.
NUMBER, RGB = r"(?P<number>-?\d+)", r"(?P<r>\d+)\s+(?P<g>\d+)\s+(?P<b>\d+)"
ROWS = (
    re.compile(rf'{NUMBER}\s+{RGB}\s+[\d.]+\s+\d+\s+\d+\s+"(?P<name>.*)"'),
    re.compile(rf"{NUMBER}\s+(?P<name>\S.*?)\s+{RGB}\s+\d+"),
)
MAX_LETTERS = 60  # of a name
LIGHTNESS, CHROMA = (85, 60, 40), 40  # of colours by number, in CIELAB
GOLDEN = (5**0.5 - 1) / 2  # of a turn, from a number to the next: no hue comes twice

Color = tuple[float, float, float]


class Label(NamedTuple):
    """A label of a file: number, name, colour, and where labels overlap, the layer that it is in."""

    number: int
    name: str
    color: Color | None = None
    layer: str | None = None
    samples: int = 0
    is_listed: bool = False  # in a table, not in the file itself


def segments_of(path: Path) -> list[Label]:
    """Return the segments that a header of 3D Slicer names; none of other files."""
    if path.suffix.lower() not in NRRD:
        return []
    labels: list[Label] = []
    with errors_at(path), reading_as("segments of 3D Slicer"):
        fields, _ = read_fields(path)
        for k in sorted(int(found[1]) for found in map(SEGMENT.fullmatch, fields) if found):
            name, value, color, layer = (
                fields.get(f"segment{k}_{key}=", "") for key in ("name", "labelvalue", "color", "layer")
            )
            r, g, b = map(float, color.split() or (-1, 0, 0))
            rgb = (r, g, b) if min(r, g, b) >= 0 and max(r, g, b) <= 1 else None
            name = readable(name, k, {each.name for each in labels})
            is_layered = len(fields.get("sizes", "").split()) == 4
            labels.append(Label(int(value or k + 1), name, rgb, layer if is_layered else None))
    return labels


def read_table(path: Path) -> list[Label]:
    """Read a table of labels: descriptions of ITK-SNAP, or a colour table of FreeSurfer or 3D Slicer.

    Raises:
        ArgumentError: if a line is of neither.
    """
    labels: list[Label] = []
    with errors_at(path), reading_as("a table of labels"):
        for count, line in enumerate(path.read_text("utf-8-sig").splitlines(), start=1):
            if not (text := line.strip()) or text.startswith("#"):
                continue
            row = next(filter(None, (kind.fullmatch(text) for kind in ROWS)), None)
            color = [int(row[key]) / 255 for key in "rgb"] if row else [2.0]
            if row is None or max(color) > 1:
                raise ArgumentError(
                    f'line {count}: expected a label, as \'1 255 0 0 1 1 1 "name"\' of ITK-SNAP or "1 name '
                    f'255 0 0 255" of FreeSurfer and 3D Slicer, got {text!r:.80}'
                )
            name = readable(row["name"], int(row["number"]), {each.name for each in labels})
            labels.append(Label(int(row["number"]), name, (color[0], color[1], color[2]), is_listed=True))
    return labels


def named_in(path: Path | None, table: Path | None) -> tuple[list[Label], Path | None]:
    """Return what a header or a table tells of the labels in a file, and a table that was found beside it.

    The labels of an array have no file.
    """
    if path and (segments := segments_of(path)):
        if table:
            raise ArgumentError(f"{table}: expected none, as {path.name} names its segments; leave it out")
        return segments, None
    if table:
        return read_table(table), None
    for beside in tables_beside(path) if path else ():
        with suppress(ArgumentError):  # another file of that name
            return read_table(beside), beside
    return [], None


def tables_beside(path: Path) -> list[Path]:
    """Return files beside a file of labels that may be its table, by its name; of FreeSurfer also its own."""
    stem = path.name.removesuffix(".gz").rpartition(".")[0]
    tables = [path.parent / (stem + suffix) for suffix in TABLES]
    if path.suffix.lower() in FREESURFER and (home := os.environ.get("FREESURFER_HOME")):
        tables.append(Path(home, "FreeSurferColorLUT.txt"))
    return [table for table in tables if table != path and table.is_file()]


def readable(name: str, number: int, taken: Container[str]) -> str:
    """Return a name as settings can hold it, which no other label and no number has."""
    plain = "".join(filter(str.isprintable, name)).replace("${", "$ {").strip()[:MAX_LETTERS]
    if not plain.strip("?") or plain.lstrip("-").isdigit() or plain in taken:
        plain = f"{plain.strip('?') or 'label'} {number}"
    return plain


def place_of_label(path: Path, name: str, numbers: Mapping[str, int]) -> tuple[str | None, int]:
    """Return layer and number of a label that is named, or given by its number.

    Raises:
        ArgumentError: if neither the file nor `numbers` has that name.
    """
    known = [*(Label(number, word) for word, number in numbers.items()), *segments_of(path)]
    if found := label_of(name, known):
        return found.layer, found.number
    if name.lstrip("-").isdigit():
        return None, int(name)
    names = ", ".join(each.name for each in known) or "those in dataset.volume.label_numbers"
    raise ArgumentError(f"{path.name}: no such label {name!r}; expected its number, or one of {names}")


def label_of(word: str, labels: Iterable[Label]) -> Label | None:
    """Return the label that a word names, or whose number it is."""
    return next((each for each in labels if word in (each.name, str(each.number))), None)


def color_of(number: int) -> Color:
    """Return the colour of a label without one, by its number alone.

    Hues turn by the golden section from number to number, and lightness takes one of three levels. Any 16
    numbers in a row are at least 20 apart in CIELAB; the 22 colours of Kelly (1965) are at least 15 apart.
    """
    import cv2

    hue = 2 * np.pi * GOLDEN * number
    lab = np.array([LIGHTNESS[number % 3], CHROMA * np.cos(hue), CHROMA * np.sin(hue)], np.float32)
    r, g, b = cv2.cvtColor(lab[None, None], cv2.COLOR_Lab2RGB)[0, 0].clip(0, 1).tolist()
    return r, g, b
