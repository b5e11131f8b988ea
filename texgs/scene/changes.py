"""Changes of a scene as words, such as TF01.palette=#ff8800 or light=headlight.

Those of cuts are cut=x,0.1, cut=-z,64v, cut=1,1,0,0.2, cut.box=-1,-1,-1,1,1,0 and cut.faces=unlit; in the
space of the volume's file cut=S,-12mm and cut=-S,64v. Places of markers are in that space, too:
marker=aorta@12.5,-30,44, distance=12.5,-30,44:20,-30,44 and marker=none.
"""

import re
from collections.abc import Sequence
from dataclasses import replace
from math import inf
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from texgs.core.cuts import AXES, NO_CUTS, Box, Cuts, Plane, along
from texgs.core.errors import ArgumentError, errors_at
from texgs.core.keys import require_keys, typed_argument
from texgs.core.markers import Marker
from texgs.core.names import is_number
from texgs.core.plain_yaml import parse_yaml
from texgs.fields.part_edit import LOOKS, require_part_key
from texgs.scene.bounds import models_of, span_of
from texgs.scene.parts import entry_of
from texgs.scene.scene import Scene
from texgs.scene.scene_file import cuts_of, plain_cuts
from texgs.scene.session import SCENE_KEYS, Session
from texgs.volume.space import Space

CUT_NUMBER = re.compile(r"cut\.([1-9])=")
PLANE = (
    "AXIS,POSITION with x, -x, y, -y, z or -z, R, A, S, L, P, I, X, Y or Z of its file, or NX,NY,NZ,OFFSET, "
    "in world units"
)
DIRECTIONS = "RASLPIXYZ"  # axes of the space of a volume's file
BOX = "X0,Y0,Z0,X1,Y1,Z1, in world units"
PLACES = {"marker": "TEXT@X,Y,Z", "distance": "X,Y,Z:X,Y,Z or TEXT@X,Y,Z:X,Y,Z"}  # words of new markers
TABLES = ("cuts", "markers")  # whole, as scene files have them; words have others
VOXEL_SUFFIX = "v"  # after a position in samples, counted from 0


def apply_all(session: Session, words: Sequence[str]) -> None:
    """Apply changes given as words, see `texgs edit --help`; an error names its word.

    Numbers of planes are those of the scene as it is now: these planes are replaced first, then taken back.
    All are one step; none is made where one cannot be.
    """
    with session.one_step():
        for word in sorted(words, key=_turn):
            with errors_at(word):
                _apply(session, word)


def _turn(word: str) -> int:
    """Return the sort key of a word: planes by number come first, removals from the last down."""
    numbered = CUT_NUMBER.match(word)
    if not numbered:
        return 0
    return -int(numbered[1]) if numbered.end() == len(word) else -10


def _apply(session: Session, word: str) -> None:
    """Apply a change KEY=VALUE."""
    name, is_edit, text = word.partition("=")
    if not is_edit:
        raise ArgumentError("expected KEY=VALUE, such as TF01.opacity=0.5")
    require_part_key(word)
    part, dot, key = name.rpartition(".")
    if part in session.scene.models or (dot and "/" in part and "/" not in key):
        _change_part(session, part, key, text)
    elif name == "cut" or part == "cut":
        cuts = changed_cuts(session.scene, key if dot else "", text)
        _require_through(session, cuts)
        session.set_cuts(cuts)
    elif name in PLACES:
        others = () if text in ("", "none") else (*session.scene.markers, _marker(session.scene, name, text))
        session.set_of_scene("markers", others)
    elif "/" in name:
        session.add_segment(name, _file(text)) if text else session.remove_segment(name)
    elif dot:
        models = ", ".join(session.scene.models)
        raise ArgumentError(f"expected a model of the scene ({models}), got {part}")
    else:
        tables = () if not text or text[0] in "[{" else TABLES
        require_keys(
            {name: text}, [each for each in (*SCENE_KEYS, "cut", *PLACES) if each not in tables], "the scene"
        )
        session.set_of_scene(name, _plain(text) if text else SCENE_KEYS[name])


def new_marker(scene: Scene, places: Any, text: str = "") -> Marker:
    """Return a marker at places [1 or 2, 3] in the volume's file, in its unit; without one, of the world."""
    try:
        points = np.array(places, float).reshape(-1, 3)
    except (TypeError, ValueError) as error:
        raise ArgumentError(f"expected three numbers a place, got {places!r:.100}") from error
    points = scene.space.in_world(points) if scene.space else points
    return typed_argument(Marker, {"points": points.tolist(), "text": text}, "marker")


def _marker(scene: Scene, name: str, text: str) -> Marker:
    """Return the marker or the distance that words stand for."""
    words, _, places = text.rpartition("@")
    rows = [each.split(",") for each in places.split(":")]
    if [len(row) for row in rows] != [3] * (1 + (name == "distance")):
        raise ArgumentError(f"expected {PLACES[name]}, got {text:.100}")
    return new_marker(scene, rows, words)


def _require_through(session: Session, cuts: Cuts) -> None:
    """Require that each new plane removes a part of the models, and that a box leaves a part."""
    scene = session.scene
    for plane in cuts.half_spaces:
        if plane in scene.cuts.half_spaces:
            continue
        composed = session.composition
        low, high = span_of(models_of(composed), scene.framed(composed), plane.normal)
        if plane.offset < low or (plane.offset > high and plane in cuts.planes):
            normal = ",".join(f"{each + 0.0:.3g}" for each in plane.normal)
            raise ArgumentError(
                f"expected a cut through the models, which lie from {low:.3g} to {high:.3g} along {normal}, "
                f"got {plane.offset:.3g}; samples are counted as in 64v"
            )


def _change_part(session: Session, part: str, key: str, text: str) -> None:
    """Change one value of a part; an empty text resets it."""
    entry_of(session.scene, part)
    if key in LOOKS:
        raise ArgumentError(
            "a look by a picture or by words is learned: by texgs view, scene.style in Python, or an edit of "
            "texgs run (docs/looks.md)"
        )
    if key in ("file", "texture"):
        session.set_file(part, key, _file(text) if text or key == "file" else None)
    elif text:
        session.set(part, key, _plain(text))
    else:
        session.reset(part, key)


def _file(text: str) -> Path:
    """Return the absolute path of an existing file."""
    if not Path(text).is_file():
        raise ArgumentError(f"expected a file that is there, got {text}")
    return Path(text).resolve()


def _plain(text: str) -> Any:
    """Read a value as YAML; also r,g,b without brackets, and #rrggbb, a comment in YAML."""
    if text.startswith("#"):
        return text
    try:
        return parse_yaml(f"[{text}]" if "," in text and text[0] not in "[{" else text)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise ArgumentError("expected a number, true, false, r,g,b, #rrggbb or a colour's name") from error


def changed_cuts(scene: Scene, key: str, text: str) -> Cuts:
    """Return the cuts of a scene with a change; an empty text removes a cut.

    Args:
        scene: of whose volume samples are counted.
        key: number of a plane from 1 on, `box`, `faces` or `window`; "" adds a plane, or takes all back.
        text: the new plane, box, kind of faces or values that slices on them show.
    """
    cuts = scene.cuts
    planes, numbers = list(cuts.planes), [str(number + 1) for number in range(len(cuts.planes))]
    if key == "box":
        corners = _places(scene, text.split(","), [0, 1, 2] * 2, BOX) if text else []
        return replace(cuts, box=Box(corners[:3], corners[3:]) if text else None)
    if key in ("faces", "window"):
        return cuts_of(plain_cuts(cuts) | {key: _plain(text) if text else getattr(NO_CUTS, key)})
    if key and key not in numbers:
        known = ", ".join(f"cut.{each}" for each in ("box", "faces", "window", *numbers))
        raise ArgumentError(f"expected cut, which adds a plane, or one of {known}, got cut.{key}")
    if key:
        planes[int(key) - 1 : int(key)] = [_plane(scene, text)] if text else []
    else:
        planes = [*planes, _plane(scene, text)] if text else []
    return replace(cuts, planes=planes)


def _plane(scene: Scene, text: str) -> Plane:
    """Return the plane at a position along an axis, or of a normal and offset; it removes the far side."""
    words = text.split(",")
    letter, sign = words[0].lstrip("+-"), -1.0 if words[0].startswith("-") else 1.0
    if len(words) != 2 or letter not in [*AXES, *DIRECTIONS]:
        numbers = _places(scene, words, [None] * 4, PLANE)
        return Plane(numbers[:3], numbers[3])
    if letter in DIRECTIONS and not words[1].endswith(VOXEL_SUFFIX):
        return _in_space(scene, letter, sign, words[1])
    normal = along(AXES.index(letter)) if letter in AXES else _towards(scene, letter)[1]
    axis = int(np.abs(normal).argmax())  # the nearest axis
    (place,) = _places(scene, words[1:], [axis], PLANE)
    return Plane(along(axis, sign if normal[axis] > 0 else -sign), sign * place)


def _in_space(scene: Scene, letter: str, sign: float, text: str) -> Plane:
    """Return the plane at a position in the file's space, along a letter's direction."""
    space, normal = _towards(scene, letter)
    form = f"{letter},POSITION in {space.unit or 'units of the file'}"
    (place,) = _places(scene, [text.removesuffix(space.unit)], [None], form)
    middle = float(space.turn @ normal @ space.points(np.zeros(3)))
    return Plane((sign * normal).tolist(), sign * (place - middle) / space.scale)


def _towards(scene: Scene, letter: str) -> tuple[Space, np.ndarray]:
    """Return the space of the volume's file, and the unit vector [3] of the world towards its letter."""
    space = scene.space
    towards = space and space.axis(letter)
    if space is None or towards is None:
        known = f"an axis of {space.name}" if space else "a scene with the space of its volume's file"
        raise ArgumentError(f"expected {known}, got {letter}; x, y and z are those of the world")
    return space, space.turn.T @ towards


def _places(scene: Scene, words: Sequence[str], axes: Sequence[int | None], form: str) -> list[float]:
    """Return numbers, one for each axis or None, see `_place`."""
    try:
        places = [_place(scene, *each) for each in zip(words, axes, strict=True)]
    except ArgumentError:  # a position in samples
        raise
    except ValueError:
        places = [inf]
    if not all(map(is_number, places)):
        raise ArgumentError(f"expected {form} or along an axis as in 64v, got {','.join(words)}")
    return places


def _place(scene: Scene, word: str, axis: int | None) -> float:
    """Return a number in world units; along an axis, the text may count samples of the volume."""
    if axis is None or not word.endswith(VOXEL_SUFFIX):
        return float(word)
    number = float(word.removesuffix(VOXEL_SUFFIX))
    if scene.volume is None:
        raise ArgumentError("expected world units, got samples: this scene names no volume")
    grid = scene.volume.open()
    low, high = (corner[axis] for corner in grid.aabb)
    return low + (high - low) * number / (grid.dims[axis] - 1)
