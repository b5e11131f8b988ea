"""Changes of a scene as words, such as TF01.palette=#ff8800, light=headlight or cut=x,0.1."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

from texgs.core.cuts import Cuts
from texgs.core.errors import ArgumentError, located
from texgs.core.plain_yaml import parse_yaml
from texgs.scene.bounds import models_of, span_of
from texgs.scene.cut_words import changed_cuts
from texgs.scene.parts import entry_of, key_path
from texgs.scene.scene_file import SEGMENT_KEYS, known
from texgs.scene.session import SCENE_KEYS, Session

NUMBERED = re.compile(r"cut\.([1-9])=")


def apply_all(session: Session, words: Sequence[str]) -> None:
    """Make the changes that words ask for, see `texgs edit --help`; an error names its word.

    Numbers of planes are those of the scene as it is now: these planes are replaced first, then taken back.
    """
    for word in sorted(words, key=_turn):
        with located(word):
            _apply(session, word)


def _turn(word: str) -> int:
    """Return when it is the turn of a word: first planes by number, of which the last is taken back first."""
    numbered = NUMBERED.match(word)
    if not numbered:
        return 0
    return -int(numbered[1]) if numbered.end() == len(word) else -10


def _apply(session: Session, word: str) -> None:
    """Make the change that a word KEY=VALUE asks for."""
    name, is_edit, text = word.partition("=")
    if not is_edit:
        raise ArgumentError("expected KEY=VALUE, such as TF01.opacity=0.5")
    part, dot, key = name.rpartition(".")
    if part in session.scene.models or (dot and "/" in part and "/" not in key):
        _change_part(session, part, key, text)
    elif name == "cut" or part == "cut":
        cuts = changed_cuts(session.scene, key if dot else "", text)
        _require_through(session, cuts)
        session.set_cuts(cuts)
    elif "/" in name:
        session.add_segment(name, _file(text)) if text else session.remove_segment(name)
    elif dot:
        models = ", ".join(session.scene.models)
        raise ArgumentError(f"expected a model of the scene ({models}), got {part}")
    else:
        _change_scene(session, name, text)


def _require_through(session: Session, cuts: Cuts) -> None:
    """Require of each new plane that it takes away some of the models, and of a box that it leaves some."""
    for plane in cuts.half_spaces:
        if plane in session.scene.cuts.half_spaces:
            continue
        composed = session.composition
        low, high = span_of(models_of(composed), session.scene.framed(composed), plane.normal)
        if plane.offset < low or (plane.offset > high and plane in cuts.planes):
            normal = ",".join(f"{each + 0.0:.3g}" for each in plane.normal)
            raise ArgumentError(
                f"expected a cut through the models, which lie from {low:.3g} to {high:.3g} along {normal}, "
                f"got {plane.offset:.3g}; samples are counted as in 64v"
            )


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
    """Change the light, the background or the step; an empty text takes it back."""
    known({key: text}, ("light", "background", "cut", "time"), "the scene")
    value = _plain(text) if text else SCENE_KEYS[key]
    if key == "light" and isinstance(value, list) and len(value) == 2:
        value = dict(zip(("azimuth", "polar"), value, strict=True))
    session.set_of_scene(key, value)


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
