"""Changes of a scene by words such as TF01.palette=#ff8800."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

from texgs.core.errors import ArgumentError, TexgsError
from texgs.core.light import HEADLIGHT
from texgs.core.plain_yaml import parse_yaml
from texgs.scene.parts import entry_of, place_of
from texgs.scene.scene import WHITE
from texgs.scene.scene_file import SEGMENT_KEYS, known, light_of
from texgs.scene.session import Session


def apply_all(session: Session, words: Sequence[str]) -> None:
    """Make the changes that words ask for.

    Raises:
        TexgsError: naming the word that cannot be done.
    """
    for word in words:
        try:
            apply(session, word)
        except TexgsError as error:
            raise type(error)(f"{word}: {error}") from error


def apply(session: Session, word: str) -> None:
    """Make the change that a word asks for.

    Raises:
        TexgsError: if it is no KEY=VALUE, or the scene has no such part, key or value.
    """
    name, is_edit, text = word.partition("=")
    if not is_edit:
        raise ArgumentError("expected KEY=VALUE, such as TF01.opacity=0.5")
    part, dot, key = name.rpartition(".")
    if part in session.scene.models or (dot and "/" in part and "/" not in key):
        change_part(session, part, key, text)
    elif "/" in name:
        session.add_segment(name, file(text)) if text else session.remove_segment(name)
    elif dot:
        models = ", ".join(session.scene.models)
        raise ArgumentError(f"expected a model of the scene ({models}), got {part}")
    else:
        change_scene(session, name, text)


def change_part(session: Session, part: str, key: str, text: str) -> None:
    """Change one value of a part; an empty text takes it back."""
    entry_of(session.scene, part)
    known({key: text}, SEGMENT_KEYS, place_of(part))
    if key == "texture":
        session.set_texture(part, file(text) if text else None)
    elif key == "file":
        session.set_file(part, file(text))
    elif text:
        session.set(part, key, plain(text))
    else:
        session.reset(part, key)


def change_scene(session: Session, key: str, text: str) -> None:
    """Change the light or the background; an empty text takes it back."""
    known({key: text}, ("light", "background"), "the scene")
    if key == "background":
        session.set_background(plain(text) if text else WHITE)
    else:
        session.set_light(light_of(light(text)) if text else HEADLIGHT)


def file(text: str) -> Path:
    """Return a file, from where one is.

    Raises:
        ArgumentError: if it is not there.
    """
    if not Path(text).is_file():
        raise ArgumentError(f"expected a file that is there, got {text}")
    return Path(text).resolve()


def plain(text: str) -> Any:
    """Return a value as YAML has it; also r,g,b without brackets, and #rrggbb, a comment in YAML."""
    if text.startswith("#"):
        return text
    try:
        return parse_yaml(f"[{text}]" if "," in text and not text.startswith("[") else text)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise ArgumentError("expected a number, true, false, r,g,b or #rrggbb") from error


def light(text: str) -> Any:
    """Return a light as scene files have it."""
    value = plain(text)
    if isinstance(value, list) and len(value) == 2:
        return dict(zip(("azimuth", "polar"), value, strict=True))
    return value
