"""scene.yaml: basic models and their edits; opening composes them and trains nothing."""

import os
from collections.abc import Callable, Mapping
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any

import yaml

from texgs.core.colors import color
from texgs.core.cuts import NO_CUTS, Cuts
from texgs.core.errors import ArgumentError, errors_at
from texgs.core.io import reading, write_bytes
from texgs.core.keys import require_keys, typed_argument
from texgs.core.lens import Frame
from texgs.core.light import HEADLIGHT, HIDING, Light
from texgs.core.markers import Marker, Markers
from texgs.core.names import METRICS, SCENE, SCENES, is_number, label, named_file, require_name, require_scene
from texgs.core.plain_yaml import parse_yaml
from texgs.fields.files import formats
from texgs.fields.part_edit import EDIT_KEYS, SEGMENT_KEYS, PartEdit
from texgs.scene.scene import WHITE, Scene, SceneModel, SceneSegment, SceneVolume
from texgs.scene.series_file import read_series
from texgs.volume.render import Appearance
from texgs.volume.space import Space
from texgs.volume.transfer import TransferFunction

VERSION = 1
EDITS = "edits"  # folder of edits, beside that of the composed scene
MAX_BYTES = 1 << 20  # a scene of a hundred models has a few thousand
SCENE_KEYS = ("light", "background", "cuts", "frame")
MAX_LISTED = 5  # scene files of a folder, in an error
KEYS = ("texgs-scene", *SCENE_KEYS, "models", "volume", "space", "functions", "markers", "series", "time")
MODEL_KEYS = (*SEGMENT_KEYS, "segments")
LIGHT_KEYS = tuple(each.name for each in fields(Light))
APPEARANCE_KEYS = tuple(each.name for each in fields(Appearance))
VOLUME_KEYS = ("file", *APPEARANCE_KEYS, "labels", "tfs")


def read_scene(path: str | Path) -> Scene:
    """Read a scene: scene.yaml, a folder with one in it or below, or a single model file.

    Files in scene.yaml are relative to its folder.

    Raises:
        ArgumentError: if the file is missing or a key of it is not as it should be; says which.
    """
    path = scene_path(path)
    if path.suffix not in SCENES:
        return Scene({label(str(path), path.stem): SceneModel(path)})
    with reading(path, "a scene in YAML", "correct it"), errors_at(path):
        if path.stat().st_size > MAX_BYTES:
            raise ArgumentError(f"expected a scene of at most {MAX_BYTES} bytes; is it another file?")
        return _scene(parse_yaml(path.read_text(encoding="utf-8")), path.parent)


def title_of(path: Path) -> str:
    """Return the name of a scene for people: data set, fit and edit of a job's, else that of its file."""
    folders = path.resolve().parent.parts
    if (path.parent / METRICS).exists():
        names = folders[-5 if folders[-2] == EDITS else -4 :]
        return " ".join(name for name in names if name not in ("scene", EDITS, "compose", "texture"))
    return folders[-1] if path.name == SCENE else path.stem


def scene_path(path: str | Path) -> Path:
    """Return the file of an argument of `read_scene`: for a folder, the scene file in it or below."""
    path = Path(path)
    require_scene(path)
    if not path.is_dir():
        if path.suffix not in SCENES and not formats(path):
            raise ArgumentError(
                f"{path}: expected scene.yaml, a folder with one or a model file (.safetensors, .texgs, "
                ".ply), got a file of another kind, or a damaged one"
            )
        return path
    files = sorted(path.rglob(SCENE))
    if len(files) != 1:
        some = ", ".join(str(each.relative_to(path)) for each in files[:MAX_LISTED])
        more = ", ..." if len(files) > MAX_LISTED else ""
        got = f"{len(files)} ({some}{more}); name one of them" if files else "none; texgs compose writes one"
        raise ArgumentError(f"{path}: expected one scene.yaml in this folder or below, got {got}")
    return files[0]


def _scene(values: Any, folder: Path) -> Scene:
    """Make a scene from the plain values of a scene file, with files relative to a folder."""
    require_keys(values, KEYS, "the scene")
    if values.get("texgs-scene") != VERSION:
        raise ArgumentError(f"texgs-scene: expected {VERSION}, got {values.get('texgs-scene')!r}")
    require_keys(values.get("models"), None, "models")
    models = {
        label("models", name): _model(f"models.{name}", x, folder) for name, x in values["models"].items()
    }
    background = color("background", values.get("background", WHITE))
    light, cuts = light_of(values.get("light", "headlight")), cuts_of(values.get("cuts", {}))
    volume = volume_of(values["volume"], folder) if "volume" in values else None
    frame = typed_argument(Frame, values["frame"], "frame") if "frame" in values else None
    functions = functions_of(values.get("functions", {}), "functions")
    space = typed_argument(Space, values["space"], "space") if "space" in values else None
    markers = markers_of(values.get("markers", []))
    scene = Scene(models, light, background, cuts, volume, frame, functions, space=space, markers=markers)
    if "series" not in values:
        return scene
    file = named_file("series", folder, values["series"], "a series")
    return replace(scene, series=read_series(file)).at(values.get("time", 0))


def write_scene(path: str | Path, scene: Scene) -> Path:
    """Write a scene file with all edits in one step; files in it are relative to its folder."""
    path = Path(path)

    def relative(file: Path) -> str:
        return Path(os.path.relpath(file.resolve(), path.parent.resolve())).as_posix()

    models = {}
    for name, entry in scene.models.items():
        segments = {key: _plain(segment, relative) for key, segment in entry.segments.items()}
        models[name] = _plain(entry, relative) | ({"segments": segments} if segments else {})
    cuts = {"cuts": plain_cuts(scene.cuts)} if scene.cuts != NO_CUTS else {}
    frame = {"frame": asdict(scene.frame)} if scene.frame else {}
    light = {"light": plain_light(scene.light)}
    of_scene = {**light, "background": list(scene.background), **cuts, **frame}
    values = {"texgs-scene": VERSION, **of_scene, "models": models}
    if scene.volume is not None:
        look = asdict(scene.volume.appearance)
        tfs = plain_functions(scene.volume.tfs)
        labels = {"labels": [*scene.volume.labels]} if scene.volume.labels else {}
        values["volume"] = {"file": relative(scene.volume.file), **look, **labels, "tfs": tfs}
    if scene.space is not None:
        values["space"] = asdict(scene.space)
    if scene.series is not None:
        values |= {"series": relative(scene.series.file), "time": scene.time}
    if scene.functions:
        values["functions"] = plain_functions(scene.functions)
    if scene.markers:
        values["markers"] = [asdict(each) for each in scene.markers]
    text = yaml.safe_dump(values, sort_keys=False, allow_unicode=True, default_flow_style=None)
    return write_bytes(path, text.encode())


def _plain(entry: SceneModel | SceneSegment, relative: Callable[[Path], str]) -> dict[str, Any]:
    """Return file, texture and edits as plain values for a scene file."""
    unedited = asdict(PartEdit())
    changed = {
        key: list(value) if isinstance(value, tuple) else value
        for key, value in asdict(entry.edit).items()
        if value != unedited[key]
    }
    variant = {} if entry.texture is None else {"texture": relative(entry.texture)}
    return {"file": relative(entry.file), **variant, **changed}


def _model(where: str, values: Any, folder: Path) -> SceneModel:
    """Make a model from the plain values of a scene file."""
    require_keys(values, MODEL_KEYS, where)
    entries = values.get("segments", {})
    require_keys(entries, None, f"{where}.segments")
    segments = {}
    for name, entry in entries.items():
        require_name(name, f"{where}.segments")
        require_keys(entry, SEGMENT_KEYS, f"{where}.segments.{name}")
        segments[str(name)] = SceneSegment(*_entry(f"{where}.segments.{name}", entry, folder, "a segment"))
    return SceneModel(*_entry(where, values, folder, "a model"), segments)


def _entry(where: str, values: Any, folder: Path, kind: str) -> tuple[Path, PartEdit, Path | None]:
    """Return the file, edit and texture of a model or a segment."""
    file, texture = named_file(f"{where}.file", folder, values.get("file"), kind), values.get("texture")
    if texture is not None:
        texture = named_file(f"{where}.texture", folder, texture, "a texture variant")
    with errors_at(where, "."):
        edit = PartEdit(**{key: value for key, value in values.items() if key in EDIT_KEYS})
    return file, edit, texture


def volume_of(values: Any, folder: Path) -> SceneVolume:
    """Make a volume from the plain values of a scene file."""
    require_keys(values, VOLUME_KEYS, "volume")
    file = named_file("volume.file", folder, values.get("file"), "a volume")
    functions = functions_of(values.get("tfs"), "volume.tfs")
    with errors_at("volume", "."):
        look = Appearance(**{key: value for key, value in values.items() if key in APPEARANCE_KEYS})
    labels = values.get("labels", [])
    if not isinstance(labels, list) or not all(isinstance(each, str) for each in labels):
        raise ArgumentError(f"volume.labels: expected a list of names, got {labels!r:.100}")
    return SceneVolume(file, functions, look, tuple(labels))


def functions_of(values: Any, where: str) -> dict[str, TransferFunction]:
    """Make transfer functions by name from a value of a scene file."""
    require_keys(values, None, where)
    functions = {}
    for name, points in values.items():
        with errors_at(f"{where}.{label(where, name)}"):
            functions[str(name)] = TransferFunction.from_dict(points)
    return functions


def plain_functions(functions: Mapping[str, TransferFunction]) -> dict[str, Any]:
    """Return transfer functions by name as plain values."""
    return {name: tf.to_dict() for name, tf in functions.items()}


def light_of(value: Any, before: Light = HEADLIGHT) -> Light:
    """Return a light from one, "headlight", azimuth and polar angle in degrees, or its values by name.

    Shadows, occlusion and reach that are not named are those of the light before; where neither the kind nor
    an angle is named, so are these.
    """
    if isinstance(value, Light):
        return value
    if isinstance(value, str) and value == "headlight":
        value = {"kind": value}
    if isinstance(value, list | tuple) and len(value) == 2:
        value = dict(zip(("azimuth", "polar"), value, strict=True))
    if not isinstance(value, dict):
        raise ArgumentError(f"light: expected headlight, or azimuth and polar in degrees, got {value!r}")
    require_keys(value, LIGHT_KEYS, "light")
    numbers = {key: number for key, number in value.items() if key != "kind"}
    for key, number in numbers.items():
        if not is_number(number):
            raise ArgumentError(f"light.{key}: expected a number, got {number!r}")
    has_angles = bool({"azimuth", "polar"} & numbers.keys())
    kind = value.get("kind", "directional" if has_angles else before.kind)
    if has_angles and kind == "headlight":
        raise ArgumentError("light: expected a headlight without angles, got some; or leave its kind out")
    kept = HIDING if has_angles or "kind" in value else (*HIDING, "azimuth", "polar")
    with errors_at("light", "."):
        values = {key: getattr(before, key) for key in kept} | {key: float(x) for key, x in numbers.items()}
        return Light(kind, **values)


def plain_light(light: Light) -> Any:
    """Return a light as plain values; what is as in `HEADLIGHT` is left out."""
    angles = {"azimuth": light.azimuth, "polar": light.polar} if light.kind == "directional" else {}
    hiding = {key: getattr(light, key) for key in HIDING if getattr(light, key) != getattr(HEADLIGHT, key)}
    return {"kind": light.kind, **angles, **hiding} if hiding else angles or "headlight"


def cuts_of(value: Any) -> Cuts:
    """Return the cuts that a value of a scene file stands for."""
    return typed_argument(Cuts, value, "cuts")


def plain_cuts(cuts: Cuts) -> dict[str, Any]:
    """Return cuts as plain values."""
    unedited = asdict(NO_CUTS)
    return {key: value for key, value in asdict(cuts).items() if value != unedited[key]}


def markers_of(value: Any) -> tuple[Marker, ...]:
    """Return the markers that a value of a scene file stands for, a list of tables."""
    return typed_argument(Markers, {"markers": value}).markers
