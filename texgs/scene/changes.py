"""Changes of a scene as words, such as TF01.palette=#ff8800, light=headlight or cut=x,0.1."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import yaml

from texgs.core.cuts import AXES, NO_CUTS, Box, Plane, along
from texgs.core.errors import ArgumentError, TexgsError
from texgs.core.names import is_number
from texgs.core.plain_yaml import parse_yaml
from texgs.scene.parts import entry_of, key_path
from texgs.scene.scene_file import SEGMENT_KEYS, cuts_of, known, plain_cuts
from texgs.scene.session import SCENE_KEYS, Session


def apply_all(session: Session, words: Sequence[str]) -> None:
    """Make the changes that words ask for, see `texgs edit --help`; an error names its word."""
    for word in words:
        try:
            _apply(session, word)
        except TexgsError as error:
            raise type(error)(f"{word}: {error}") from error


def _apply(session: Session, word: str) -> None:
    """Make the change that a word KEY=VALUE asks for."""
    name, is_edit, text = word.partition("=")
    if not is_edit:
        raise ArgumentError("expected KEY=VALUE, such as TF01.opacity=0.5")
    part, dot, key = name.rpartition(".")
    if part in session.scene.models or (dot and "/" in part and "/" not in key):
        _change_part(session, part, key, text)
    elif name == "cut" or part == "cut":
        _change_cuts(session, key if dot else "", text)
    elif "/" in name:
        session.add_segment(name, _file(text)) if text else session.remove_segment(name)
    elif dot:
        models = ", ".join(session.scene.models)
        raise ArgumentError(f"expected a model of the scene ({models}), got {part}")
    else:
        _change_scene(session, name, text)


def _change_part(session: Session, part: str, key: str, text: str) -> None:
    """Change one value of a part; an empty text takes it back."""
    entry_of(session.scene, part)
    known({key: text}, SEGMENT_KEYS, key_path(part))
    if key == "texture":
        session.set_texture(part, _file(text) if text else None)
    elif key == "file":
        session.set_file(part, _file(text))
    elif text:
        session.set(part, key, _plain(text))
    else:
        session.reset(part, key)


def _change_scene(session: Session, key: str, text: str) -> None:
    """Change the light or the background; an empty text takes it back."""
    value = _plain(text) if text else SCENE_KEYS.get(key)
    if key == "light" and isinstance(value, list) and len(value) == 2:
        value = dict(zip(("azimuth", "polar"), value, strict=True))
    session.set_of_scene(key, value)


def _change_cuts(session: Session, key: str, text: str) -> None:
    """Add a plane, or change one by its number, the box or the faces; an empty text takes it back."""
    cuts = session.scene.cuts
    planes, numbers = list(cuts.planes), [str(n) for n in range(1, len(cuts.planes) + 1)]
    if key == "box":
        cuts = replace(cuts, box=_box(text) if text else None)
    elif key == "faces":
        cuts = cuts_of(plain_cuts(cuts) | {"faces": text or NO_CUTS.faces})
    elif key in numbers:
        planes[int(key) - 1 : int(key)] = [_plane(text)] if text else []
    elif key:
        raise ArgumentError(
            f"expected cut, cut.box, cut.faces or cut.{' or '.join(numbers) or 'NUMBER'}, got cut.{key}"
        )
    else:
        planes = [*planes, _plane(text)] if text else []
    session.set_cuts(replace(cuts, planes=planes))


def _plane(text: str) -> Plane:
    """Return the plane of AXIS,POSITION, which takes away what is beyond, or of NX,NY,NZ,OFFSET."""
    axis, _, position = text.rpartition(",")
    sign = -1.0 if axis.startswith("-") else 1.0
    if len(name := axis.lstrip("+-")) == 1 and name in AXES and is_number(place := _plain(position)):
        return Plane(along(AXES.index(name), sign), sign * place)
    numbers = _numbers(text, 4, "AXIS,POSITION with x, -x, y, -y, z or -z, or NX,NY,NZ,OFFSET")
    return Plane(numbers[:3], numbers[3])


def _box(text: str) -> Box:
    """Return the box of its low and its high corner."""
    numbers = _numbers(text, 6, "X0,Y0,Z0,X1,Y1,Z1")
    return Box(numbers[:3], numbers[3:])


def _numbers(text: str, count: int, form: str) -> list[float]:
    """Return so many numbers with commas between them."""
    values = _plain(text)
    if not isinstance(values, list) or len(values) != count or not all(map(is_number, values)):
        raise ArgumentError(f"expected {form}, in world units, got {text}")
    return [float(value) for value in values]


def _file(text: str) -> Path:
    """Return the whole path of a file that is there."""
    if not Path(text).is_file():
        raise ArgumentError(f"expected a file that is there, got {text}")
    return Path(text).resolve()


def _plain(text: str) -> Any:
    """Read a value as YAML; also r,g,b without brackets, and #rrggbb, which YAML takes for a comment."""
    if text.startswith("#"):
        return text
    try:
        return parse_yaml(f"[{text}]" if "," in text and not text.startswith("[") else text)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise ArgumentError("expected a number, true, false, r,g,b or #rrggbb") from error
