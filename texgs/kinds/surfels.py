"""Textured 2D Gaussians: what the paper is about. All edits work on them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from texgs.config.fields import ALL, Kind

if TYPE_CHECKING:
    from torch import Tensor

    from texgs.fields.surfels.composition import Composition
    from texgs.fields.surfels.model import Surfels


def read(path: Path) -> Surfels:
    """The surfels in a file, lossless, compact or PLY."""
    from texgs.core.ply_file import is_ply
    from texgs.fields.surfels.compact import open_model
    from texgs.fields.surfels.ply import read_ply

    return read_ply(path) if is_ply(path) else open_model(path)


def write(path: Path, field: Surfels) -> Path:
    """Write surfels without loss."""
    from texgs.fields.surfels.model_file import write_model

    return write_model(path, field)


def compose(fields: Sequence[Surfels], segments: Sequence[Sequence[Tensor]]) -> Composition:
    """Surfels as one scene: joined, so that they are sorted and blended together."""
    from texgs.fields.surfels.composition import Composition

    return Composition(fields, segments)


FIELD: Kind[None] = Kind(
    "surfels",
    "textured 2D Gaussians",
    ("texgs-model", "texgs-compact", "ply scale_1"),
    ALL,
    read,
    write,
    compose,
    phases=("surfels", "shading", "texture"),
    exports=("3dgs", "2dgs", "release", "points", "mesh", "compact", "html"),
    depth="median",
)
