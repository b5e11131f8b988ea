"""Cuts as words: cut=x,0.1, cut=-z,64v, cut=1,1,0,0.2, cut.box=-1,-1,-1,1,1,0, cut.faces=unlit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from texgs.core.cuts import AXES, NO_CUTS, Box, Cuts, Plane, along
from texgs.core.errors import ArgumentError
from texgs.core.names import is_number
from texgs.scene.scene import Scene
from texgs.scene.scene_file import cuts_of, plain_cuts
from texgs.volume.nrrd_file import open_grid

PLANE = "AXIS,POSITION with x, -x, y, -y, z or -z, or NX,NY,NZ,OFFSET"
BOX = "X0,Y0,Z0,X1,Y1,Z1"
VOXELS = "v"  # behind a position along an axis that counts samples, the first of which is 0


def changed_cuts(scene: Scene, key: str, text: str) -> Cuts:
    """Return the cuts of a scene with a change; an empty text takes something back.

    Args:
        scene: of whose volume samples are counted.
        key: number of a plane from 1 on, `box` or `faces`; "" adds a plane, or takes all of them back.
        text: the new plane, box or kind of faces.
    """
    cuts = scene.cuts
    planes, numbers = list(cuts.planes), [str(number + 1) for number in range(len(cuts.planes))]
    if key == "box":
        return replace(cuts, box=_box(scene, text) if text else None)
    if key == "faces":
        return cuts_of(plain_cuts(cuts) | {"faces": text or NO_CUTS.faces})
    if key and key not in numbers:
        known = ", ".join(f"cut.{each}" for each in ("box", "faces", *numbers))
        raise ArgumentError(f"expected cut, which adds a plane, or one of {known}, got cut.{key}")
    if key:
        planes[int(key) - 1 : int(key)] = [_plane(scene, text)] if text else []
    else:
        planes = [*planes, _plane(scene, text)] if text else []
    return replace(cuts, planes=planes)


def _plane(scene: Scene, text: str) -> Plane:
    """Return the plane at a position of an axis, which takes away what is beyond; or of normal and offset."""
    words = text.split(",")
    axis = words[0].lstrip("+-")
    if len(words) == 2 and len(axis) == 1 and axis in AXES:
        sign, number = -1.0 if words[0].startswith("-") else 1.0, AXES.index(axis)
        return Plane(along(number, sign), sign * _places(scene, [words[1]], [number], PLANE)[0])
    numbers = _places(scene, words, [None] * 4, PLANE)
    return Plane(numbers[:3], numbers[3])


def _box(scene: Scene, text: str) -> Box:
    """Return the box between two corners."""
    numbers = _places(scene, text.split(","), [0, 1, 2] * 2, BOX)
    return Box(numbers[:3], numbers[3:])


def _places(scene: Scene, words: Sequence[str], axes: Sequence[int | None], form: str) -> list[float]:
    """Return numbers in world units; those along an axis may count samples of the volume."""
    places = []
    for word, axis in zip(words, axes, strict=False):
        counts = axis is not None and word.endswith(VOXELS)
        try:
            number = float(word.removesuffix(VOXELS) if counts else word)
        except ValueError:
            break
        places.append(_of_sample(scene, axis, number) if counts and axis is not None else number)
    if len(words) != len(axes) or len(places) != len(axes) or not all(map(is_number, places)):
        raise ArgumentError(
            f"expected {form}, in world units or along an axis as in 64v, got {','.join(words)}"
        )
    return places


def _of_sample(scene: Scene, axis: int, number: float) -> float:
    """Return the place of a sample along an axis, world units."""
    if scene.volume is None:
        raise ArgumentError("expected world units, got samples: this scene names no volume")
    grid = open_grid(scene.volume.file)
    low, high = (corner[axis] for corner in grid.aabb)
    return low + (high - low) * number / (grid.dims[axis] - 1)
