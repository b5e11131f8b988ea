"""scene.yaml: basic models and what is edited about each; opening composes them and trains nothing."""

import os
from collections.abc import Callable, Collection, Mapping
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any

import yaml

from texgs.core.cuts import NO_CUTS, Cuts
from texgs.core.errors import ArgumentError, located
from texgs.core.io import reading, write_bytes
from texgs.core.keys import typed_argument
from texgs.core.lens import Frame
from texgs.core.light import HEADLIGHT, Light
from texgs.core.names import SCENE, SCENES, close, is_number, label, named_file, require_name
from texgs.core.plain_yaml import parse_yaml
from texgs.fields.files import formats
from texgs.fields.part_edit import PartEdit, color
from texgs.scene.scene import WHITE, Scene, SceneModel, SceneSegment, SceneVolume
from texgs.scene.series_file import read_series
from texgs.volume.render import Appearance
from texgs.volume.space import Space
from texgs.volume.transfer import TransferFunction

VERSION = 1
LARGEST = 1 << 20  # bytes; with a hundred models a scene has a few thousand
OF_SCENE = ("light", "background", "cuts", "frame")
MOST_LISTED = 5  # scene files of a folder, in an error
KEYS = ("texgs-scene", *OF_SCENE, "models", "volume", "space", "functions", "series", "time")
EDITS = tuple(each.name for each in fields(PartEdit))
SEGMENT_KEYS = ("file", "texture", *EDITS)
MODEL_KEYS = (*SEGMENT_KEYS, "segments")
LOOK = tuple(each.name for each in fields(Appearance))
VOLUME_KEYS = ("file", *LOOK, "tfs")


def read_scene(path: str | Path) -> Scene:
    """Read a scene: scene.yaml, a folder with one in it or below, or a model file, a scene of its own.

    Files in scene.yaml are relative to its folder.

    Raises:
        ArgumentError: if the file is missing or a key of it is not as it should be; says which.
    """
    path = scene_path(path)
    if path.suffix not in SCENES:
        return Scene({label(str(path), path.stem): SceneModel(path)})
    with reading(path, "a scene in YAML", "correct it"), located(path):
        if path.stat().st_size > LARGEST:
            raise ArgumentError(f"expected a scene of at most {LARGEST} bytes; is it another file?")
        return _scene(parse_yaml(path.read_text(encoding="utf-8")), path.parent)


def scene_path(path: str | Path) -> Path:
    """Return the file of what `read_scene` takes: of a folder, the scene file in it or below."""
    path = Path(path)
    if not path.exists():
        raise ArgumentError(
            f"{path}: no such scene, folder or model; check its name, or let texgs compose write a scene"
        )
    if not path.is_dir():
        if path.suffix not in SCENES and not formats(path):
            raise ArgumentError(
                f"{path}: expected scene.yaml, a folder with one or a model file (.safetensors, .texgs, "
                ".ply), got a file of another kind, or a damaged one"
            )
        return path
    files = sorted(path.rglob(SCENE))
    if len(files) != 1:
        some = ", ".join(str(each.relative_to(path)) for each in files[:MOST_LISTED])
        more = ", ..." if len(files) > MOST_LISTED else ""
        got = f"{len(files)} ({some}{more}); name one of them" if files else "none; texgs compose writes one"
        raise ArgumentError(f"{path}: expected one scene.yaml in this folder or below, got {got}")
    return files[0]


def _scene(values: Any, folder: Path) -> Scene:
    """Return the scene that the plain values of a scene file describe, with files in a folder."""
    known(values, KEYS, "the scene")
    if values.get("texgs-scene") != VERSION:
        raise ArgumentError(f"texgs-scene: expected {VERSION}, got {values.get('texgs-scene')!r}")
    known(values.get("models"), None, "models")
    models = {
        label("models", name): _model(f"models.{name}", x, folder) for name, x in values["models"].items()
    }
    background = color("background", values.get("background", WHITE))
    light, cuts = light_of(values.get("light", "headlight")), cuts_of(values.get("cuts", {}))
    volume = volume_of(values["volume"], folder) if "volume" in values else None
    frame = typed_argument(Frame, values["frame"], "frame") if "frame" in values else None
    functions = functions_of(values.get("functions", {}), "functions")
    space = typed_argument(Space, values["space"], "space") if "space" in values else None
    scene = Scene(models, light, background, cuts, volume, frame, functions, space=space)
    if "series" not in values:
        return scene
    file = named_file("series", folder, values["series"], "a series")
    return replace(scene, series=read_series(file)).at(values.get("time", 0))


def write_scene(path: str | Path, scene: Scene) -> Path:
    """Write a scene file in one step, with what is edited; files in it are relative to its folder."""
    path = Path(path)

    def relative(file: Path) -> str:
        return Path(os.path.relpath(file.resolve(), path.parent.resolve())).as_posix()

    models = {}
    for name, entry in scene.models.items():
        segments = {key: _plain(segment, relative) for key, segment in entry.segments.items()}
        models[name] = _plain(entry, relative) | ({"segments": segments} if segments else {})
    light: Any = "headlight"
    if scene.light.kind == "directional":
        light = {"azimuth": scene.light.azimuth, "polar": scene.light.polar}
    cuts = {"cuts": plain_cuts(scene.cuts)} if scene.cuts != NO_CUTS else {}
    frame = {"frame": asdict(scene.frame)} if scene.frame else {}
    of_scene = {"light": light, "background": list(scene.background), **cuts, **frame}
    values = {"texgs-scene": VERSION, **of_scene, "models": models}
    if scene.volume is not None:
        look = asdict(scene.volume.appearance)
        tfs = plain_functions(scene.volume.tfs)
        values["volume"] = {"file": relative(scene.volume.file), **look, "tfs": tfs}
    if scene.space is not None:
        values["space"] = asdict(scene.space)
    if scene.series is not None:
        values |= {"series": relative(scene.series.file), "time": scene.time}
    if scene.functions:
        values["functions"] = plain_functions(scene.functions)
    text = yaml.safe_dump(values, sort_keys=False, allow_unicode=True, default_flow_style=None)
    return write_bytes(path, text.encode())


def _plain(entry: SceneModel | SceneSegment, relative: Callable[[Path], str]) -> dict[str, Any]:
    """Return the file, texture and what is edited, as a scene file has them."""
    unedited = asdict(PartEdit())
    changed = {
        key: list(value) if isinstance(value, tuple) else value
        for key, value in asdict(entry.edit).items()
        if value != unedited[key]
    }
    variant = {} if entry.texture is None else {"texture": relative(entry.texture)}
    return {"file": relative(entry.file), **variant, **changed}


def _model(where: str, values: Any, folder: Path) -> SceneModel:
    """Return a model of the plain values of a scene file."""
    known(values, MODEL_KEYS, where)
    entries = values.get("segments", {})
    known(entries, None, f"{where}.segments")
    segments = {}
    for name, entry in entries.items():
        require_name(name, f"{where}.segments")
        known(entry, SEGMENT_KEYS, f"{where}.segments.{name}")
        segments[str(name)] = SceneSegment(*_entry(f"{where}.segments.{name}", entry, folder, "a segment"))
    return SceneModel(*_entry(where, values, folder, "a model"), segments)


def _entry(where: str, values: Any, folder: Path, kind: str) -> tuple[Path, PartEdit, Path | None]:
    """Return the file, edit and texture of a model or a segment."""
    file, texture = named_file(f"{where}.file", folder, values.get("file"), kind), values.get("texture")
    if texture is not None:
        texture = named_file(f"{where}.texture", folder, texture, "a texture variant")
    with located(where, "."):
        edit = PartEdit(**{key: value for key, value in values.items() if key in EDITS})
    return file, edit, texture


def volume_of(values: Any, folder: Path) -> SceneVolume:
    """Return the volume of the plain values of a scene file."""
    known(values, VOLUME_KEYS, "volume")
    file = named_file("volume.file", folder, values.get("file"), "a volume")
    functions = functions_of(values.get("tfs"), "volume.tfs")
    with located("volume", "."):
        look = Appearance(**{key: value for key, value in values.items() if key in LOOK})
    return SceneVolume(file, functions, look)


def functions_of(values: Any, where: str) -> dict[str, TransferFunction]:
    """Return transfer functions by name that a value of a scene file stands for."""
    known(values, None, where)
    functions = {}
    for name, points in values.items():
        with located(f"{where}.{label(where, name)}"):
            functions[str(name)] = TransferFunction.from_dict(points)
    return functions


def plain_functions(functions: Mapping[str, TransferFunction]) -> dict[str, Any]:
    """Return transfer functions by name as a scene file has them."""
    return {name: tf.to_dict() for name, tf in functions.items()}


def light_of(value: Any) -> Light:
    """Return a light from one, "headlight", or azimuth and polar angle in degrees, with or without names."""
    if isinstance(value, Light):
        return value
    if isinstance(value, str) and value == "headlight":
        return HEADLIGHT
    if isinstance(value, list | tuple) and len(value) == 2:
        value = dict(zip(("azimuth", "polar"), value, strict=True))
    if isinstance(value, dict) and set(value) <= {"azimuth", "polar"} and all(map(is_number, value.values())):
        return Light("directional", **{key: float(angle) for key, angle in value.items()})
    raise ArgumentError(f"light: expected headlight, or azimuth and polar in degrees, got {value!r}")


def cuts_of(value: Any) -> Cuts:
    """Return the cuts that a value of a scene file stands for."""
    return typed_argument(Cuts, value, "cuts")


def plain_cuts(cuts: Cuts) -> dict[str, Any]:
    """Return cuts as a scene file has them."""
    unedited = asdict(NO_CUTS)
    return {key: value for key, value in asdict(cuts).items() if value != unedited[key]}


def known(values: Any, keys: Collection[str] | None, where: str) -> None:
    """Require a table, with known keys only; a slip names the key that is most like it."""
    if not isinstance(values, dict):
        raise ArgumentError(f"{where}: expected a table of keys and values, got {values!r}")
    for key in values if keys is not None else ():
        if key not in keys:  # type: ignore[operator]
            hint = close(key, keys or ()) or f"; expected {', '.join(keys or ())}"
            raise ArgumentError(f"{where}: no such key {key!r}{hint}")
