"""Segments of scenes: the views that vote on one, its name, its file."""

from __future__ import annotations

import sys
from dataclasses import replace
from math import isqrt
from pathlib import Path
from typing import Any

import torch

from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.core.lens import Lens
from texgs.core.names import label
from texgs.fields.surfels.model import Surfels
from texgs.scene.scene_file import RESERVED, Scene, SceneSegment
from texgs.scene.segment_file import read_segment, write_segment
from texgs.volume.cameras import icosphere


def voting_views(count: int, lens: Lens) -> list[Camera]:
    """Cameras on an icosphere.

    Raises:
        ArgumentError: if no icosphere has so many.
    """
    frequency = isqrt(max(count - 2, 0) // 10)
    if frequency < 1 or 10 * frequency**2 + 2 != count:
        raise ArgumentError(f"views: expected 12, 42, 92, 162 or another 10 f^2 + 2, got {count}")
    return icosphere(frequency, *lens)


def require_name(name: str | None, where: str) -> None:
    """Require a name that a segment can have.

    Raises:
        ArgumentError: naming where it comes from.
    """
    if not name or any(mark in label(where, name) for mark in RESERVED):
        raise ArgumentError(f"{where}: expected a name without {' '.join(RESERVED)}, got {name}")


def require_new(scene: Scene, part: str) -> None:
    """Require that the model of MODEL/SEGMENT has no such segment.

    Raises:
        ArgumentError: if it has.
    """
    name, _, new = part.rpartition("/")  # names of models may have the mark
    if new in scene.models[name].segments:
        raise ArgumentError(
            f"{part}: is there already; choose another name, or remove it by texgs edit {part}="
        )


def with_segment(
    scene: Scene, part: str, model: Surfels, mask: torch.Tensor, file: Path, facts: dict[str, Any]
) -> Scene:
    """Write the file of a new segment; the scene that has it, and looks as before.

    Args:
        scene: that gets it.
        part: MODEL/SEGMENT.
        model: of that name.
        mask: [N] bool.
        file: target.
        facts: what the segment comes from, JSON.

    Raises:
        ArgumentError: if earlier segments have all of its surfels.
    """
    name, _, new = part.rpartition("/")  # names of models may have the mark
    entry = scene.models[name]
    free = mask.clone()
    for other in entry.segments.values():
        free &= ~read_segment(other.file, model)
    if not bool(free.any()):
        raise ArgumentError(
            f"{part}: expected surfels that no segment of {name} has, got none; remove one that has them "
            f"({', '.join(entry.segments)})"
        )
    held, count = int((mask & ~free).sum()), int(mask.sum())
    note = f", of which {held} stay with earlier segments" if held else ""
    sys.stderr.write(f"{part}: {count} of {len(mask)} surfels{note}\n")
    write_segment(file, model, mask, facts)
    segment = SceneSegment(file, entry.edit, entry.texture)
    changed = replace(entry, segments={**entry.segments, new: segment})
    return replace(scene, models={**scene.models, name: changed})
