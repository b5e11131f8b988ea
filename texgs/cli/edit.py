"""Edit a scene by words such as TF01.palette=#ff8800 and write it to a new file; nothing is trained."""

import argparse
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from texgs.scene.scene_file import Scene


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The scene, the edits, the new file."""
    parser.add_argument("scene", type=Path, help="scene.yaml")
    parser.add_argument(
        "overrides",
        nargs="*",
        metavar="KEY=VALUE",
        help="MODEL.KEY=VALUE with visible, palette (r,g,b from 0 to 1, or #rrggbb), opacity, ambient, "
        "diffuse, specular, shininess (factors) or texture (a file); light=headlight or light=AZIMUTH,POLAR; "
        "background=#rrggbb; MODEL.KEY= takes an edit back; MODEL/SEGMENT.KEY=VALUE edits a segment, "
        "MODEL/SEGMENT=FILE adds one from a file and MODEL/SEGMENT= removes it",
    )
    parser.add_argument("--output", type=Path, required=True, help="the new scene.yaml")


def run(arguments: argparse.Namespace) -> int:
    """Write the edited scene."""
    from texgs.core.errors import ArgumentError
    from texgs.scene.scene_file import read_scene, read_values, scene_of, write_scene

    before = read_scene(arguments.scene)  # says what is wrong with it before anything is changed
    values = read_values(arguments.scene)
    values["models"] = {str(name): entry for name, entry in values["models"].items()}
    for word in arguments.overrides:
        try:
            apply(values, word, arguments.scene.parent)
            scene = scene_of(values, arguments.scene.parent)
        except ArgumentError as error:
            raise ArgumentError(f"{word}: {error}") from error
    scene = scene_of(values, arguments.scene.parent)
    require_openable(scene, before)
    print(write_scene(arguments.output, scene))
    return 0


def require_openable(scene: "Scene", before: "Scene") -> None:
    """Require that the files that edits have brought into a scene are there, whole, and of its models.

    Raises:
        ArgumentError, ShapeError: naming the model and the file.
    """
    from texgs.core.errors import TexgsError

    for name, entry in scene.models.items():
        if name in before.models and entry.files == before.models[name].files:
            continue
        try:
            entry.open()
        except TexgsError as error:
            raise type(error)(f"models.{name}: {error}") from error


def apply(values: dict[str, Any], word: str, folder: Path) -> None:
    """Set one key of a scene's plain values; files in them are relative to the folder.

    Raises:
        ArgumentError: if the word is no KEY=VALUE or names no model.
    """
    from texgs.core.errors import ArgumentError

    key, is_edit, text = word.partition("=")
    if not is_edit:
        raise ArgumentError("expected KEY=VALUE, such as TF01.opacity=0.5")
    table, key = place(values, key, is_new=text != "")
    if text == "":
        table.pop(key, None)
    elif key in ("file", "texture"):
        table[key] = file(text, folder)
    else:
        table[key] = light(text) if key == "light" else plain(text)


def place(values: dict[str, Any], key: str, is_new: bool) -> tuple[dict[str, Any], str]:
    """The table of a scene's plain values that a key is in, and the key there.

    MODEL/SEGMENT is the file of a segment where one is given (`is_new`), else the segment itself.

    Raises:
        ArgumentError: if there is no such model or segment.
    """
    from texgs.core.errors import ArgumentError

    models = values["models"]
    name, dot, last = key.rpartition(".")
    if name in models:
        return models[name], last
    if not dot and "/" not in key:
        return values, key
    name, slash, rest = key.rpartition("/")  # names of models may have both marks, those of segments none
    if not slash or name not in models:
        raise ArgumentError(
            f"expected a model of the scene ({', '.join(models)}), got {name or key.rpartition('.')[0]}"
        )
    segments = {str(found): entry for found, entry in models[name].get("segments", {}).items()}
    models[name]["segments"] = segments
    segment, dot, last = rest.partition(".")
    if is_new and not dot:
        return segments.setdefault(segment, {}), "file"
    if segment not in segments:
        known = ", ".join(segments) or "it has none"
        raise ArgumentError(f"expected a segment of {name} ({known}), got {segment}")
    return (segments[segment], last) if dot else (segments, segment)


def file(text: str, folder: Path) -> str:
    """A file, named from where one is, as scenes in a folder name it.

    Raises:
        ArgumentError: if it is not there.
    """
    from texgs.core.errors import ArgumentError

    if not Path(text).is_file():
        raise ArgumentError(f"expected a file that is there, got {text}")
    return Path(os.path.relpath(Path(text).resolve(), folder.resolve())).as_posix()


def plain(text: str) -> Any:
    """A value as YAML has it; also r,g,b without brackets, and #rrggbb, which YAML takes for a comment."""
    import yaml

    from texgs.core.errors import ArgumentError
    from texgs.core.plain_yaml import parse_yaml

    if text.startswith("#"):
        return text
    try:
        return parse_yaml(f"[{text}]" if "," in text and not text.startswith("[") else text)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise ArgumentError("expected a number, true, false, r,g,b or #rrggbb") from error


def light(text: str) -> Any:
    """A light as scene files have it."""
    value = plain(text)
    if isinstance(value, list) and len(value) == 2:
        return dict(zip(("azimuth", "polar"), value, strict=True))
    return value
