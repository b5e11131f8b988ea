"""Files of fields of any kind, recognised by their first bytes."""

import json
from pathlib import Path

from texgs.core.ply_file import is_ply, properties
from texgs.fields.field import Field
from texgs.fields.kinds import Kind, kinds

MAX_HEADER_BYTES = 1 << 20  # headers of fields have about 1 KiB
DEFAULT_KIND = "surfels"  # its reader reports the error in a file of no known kind


def open_field(path: str | Path) -> Field:
    """Read a field of any kind to the CPU. Nothing in the file is executed.

    Raises:
        ArgumentError, ShapeError: if the file is missing, damaged or of no kind.
    """
    path = Path(path)
    field: Field = kind_of(path).read(path)
    return field


def kind_of(path: Path) -> Kind:
    """Return the kind of the field in a file, by its header."""
    names, known = formats(path), kinds()
    return next((kind for kind in known.values() if names & {*kind.formats}), known[DEFAULT_KIND])


def formats(path: Path) -> set[str]:
    """Return the entries of a file's header, one of which names its format; none without our header.

    Files of fields are safetensors with one entry of metadata, begin with a line of JSON, or are PLY files,
    which are told apart by their properties: 3D Gaussians have a third scale, and surfels with shading may.
    """
    try:
        if is_ply(path):
            named = properties(path)
            scales = {"scale_1"} if "ambient_factor" in named else named & {"scale_1", "scale_2"}
            return {f"ply {max(scales)}"} if scales else set()
        with path.open("rb") as file:
            start = file.read(9)
            if start[:1] == b"{":
                header = json.loads(start + file.readline(MAX_HEADER_BYTES))
            else:
                length = min(int.from_bytes(start[:8], "little"), MAX_HEADER_BYTES)
                header = json.loads(start[8:] + file.read(max(length - 1, 0))).get("__metadata__", {})
    except (OSError, ValueError, AttributeError, RecursionError):
        return set()
    return set(header) if isinstance(header, dict) else set()
