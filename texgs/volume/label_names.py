"""Names and colours of labels, from where people keep them."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from texgs.core.errors import ArgumentError
from texgs.volume.headers import NRRD, read_fields

SEGMENTATION = ".seg.nrrd"  # of 3D Slicer; its header names segments


class Label(NamedTuple):
    """A label of a file: number, name, colour, and where labels overlap, the layer that it is in."""

    number: int
    name: str
    color: tuple[float, float, float] | None = None
    layer: str | None = None


def segments_of(path: Path) -> list[Label]:
    """Return the segments that a header of 3D Slicer names; none of other files."""
    if path.suffix.lower() not in NRRD:
        return []
    fields, _ = read_fields(path)
    count = sum(name.startswith("segment") and name.endswith("_name=") for name in fields)
    labels = []
    for k in range(count):
        said = {key: fields.get(f"segment{k}_{key}=", "") for key in ("name", "labelvalue", "color", "layer")}
        color = tuple(float(each) for each in said["color"].split())
        layer = said["layer"] if len(fields.get("sizes", "").split()) == 4 else None
        rgb = (color[0], color[1], color[2]) if len(color) == 3 else None
        labels.append(Label(int(said["labelvalue"] or k + 1), said["name"], rgb, layer))
    return labels


def place_of_label(path: Path, name: str, numbers: Mapping[str, int]) -> tuple[str | None, int]:
    """Return layer and number of a label that is named, or given by its number.

    Raises:
        ArgumentError: if neither the file nor `numbers` has that name.
    """
    if name in numbers:
        return None, numbers[name]
    segments = segments_of(path)
    for each in segments:
        if each.name == name:
            return each.layer, each.number
    if name.lstrip("-").isdigit():
        return None, int(name)
    known = ", ".join([*numbers, *(each.name for each in segments)]) or "its number"
    raise ArgumentError(f"{path.name}: no such label {name!r}; expected one of {known}")
