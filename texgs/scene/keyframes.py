"""Keyframes of a film: keys with a camera and changes of the scene, and what is between them."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import torch

from texgs.core.errors import ArgumentError, errors_at
from texgs.core.io import reading
from texgs.core.keys import key, require_keys, typed_argument
from texgs.core.names import is_number
from texgs.core.oklab import from_oklab, oklab
from texgs.core.plain_yaml import parse_yaml
from texgs.fields.field import Composed
from texgs.scene.changes import PLACES, apply_all
from texgs.scene.parts import entry_of, part_names, split
from texgs.scene.scene import Scene
from texgs.scene.session import SCENE_KEYS, Session
from texgs.scene.shot import Shot

KEPT = ("azimuth", "polar", "radius", "fov_y", "target", "seconds")  # by keys that do not name them
COLORS = ("palette", "tint", "background")  # they move in OKLab
as_json = partial(json.dumps, default=str, ensure_ascii=False)
Stop = tuple[Any, Scene]  # a shot, and what it shows


@dataclass(frozen=True)
class Key(Shot):
    """A shot that a film passes, and what changes of the scene since the key before."""

    seconds: float = key(2.0, "to the next key", above=0, most=86400)
    words: tuple[str, ...] = ()  # changes, see `apply_all`
    at: int = 0  # frame
    where: str = ""  # file and number, from 1 on


def read_keys(keys: Any, start: Shot, fps: float) -> list[Key]:
    """Return the keys of a file or a list, two or more; what the first does not name is that of a shot."""
    is_file = isinstance(keys, str | Path)
    rows, file = keys, str(keys) if is_file else "keys"
    if is_file:
        with reading(keys, "keyframes in YAML", "correct it") as path, errors_at(path):
            rows = parse_yaml(path.read_text(encoding="utf-8"))
    if not isinstance(rows, list | tuple) or len(rows) < 2:
        raise ArgumentError(f"{file}: expected a list of two keys or more, got {rows!r:.60}")
    made, values = list[Key](), {each.name: getattr(start, each.name) for each in fields(Shot)}
    for number, row in enumerate(rows, 1):
        with errors_at(where := f"{file}: key {number}"):
            require_keys(row, None, "a key")
            of_parts = (str(name) for name in row if {*"./"} & {*str(name)})
            require_keys(row, (*KEPT, "cut", *PLACES, *SCENE_KEYS, *of_parts), "a key")
            values |= {name: row[name] for name in KEPT if name in row} | {"where": where}
            texts = {name: x if isinstance(x, str) else as_json(x) for name, x in row.items()}
            values["words"] = [f"{n}={'' if x == 'null' else x}" for n, x in texts.items() if n not in KEPT]
            values["at"] = made[-1].at + max(1, round(made[-1].seconds * fps)) if made else 0
            made.append(typed_argument(Key, values))
    return made


def keyed_shots(keys: Sequence[Key], scene: Scene, composed: Composed) -> Iterator[Stop]:
    """Return shot and scene of each frame from the first key to the last; those of a key are its own.

    Numbers and colours move on monotone cubic splines, angles the short way, and planes along their normals;
    all else changes at its key. `composed` are the models of the scene. An error names its key.
    """
    session, stops = Session(scene), dict[int, Stop]()
    fitted = dict(zip(scene.models, np.clip(composed.palettes, 0, 1).tolist(), strict=True))
    colored = {each.partition(".palette=")[0] for key in keys for each in key.words if ".palette=" in each}
    for each in keys:
        with errors_at(each.where):
            apply_all(session, each.words)
            for part in colored.intersection(part_names(session.scene)):  # a fitted colour can move, too
                if entry_of(session.scene, part).edit.palette is None:
                    session.set(part, "palette", fitted[split(scene, part)[0]])
            framed = session.scene.frame or session.scene.framed(session.composition)
            each.camera(framed)
        lens: Any = each.lens(framed)
        azimuth = framed.azimuth if each.azimuth is None else each.azimuth
        seen = replace(each, azimuth=azimuth, radius=lens.radius, target=tuple(lens.target), words=())
        stops[each.at] = seen, session.scene
    return between(stops)


def between(stops: Mapping[int, Stop]) -> Iterator[Stop]:
    """Yield what is at each frame from the first stop to the last: stops, and what is between two."""
    for span in pairwise(stops):
        yield stops[span[0]]
        for frame in range(span[0] + 1, span[1]):
            shot, scene = mixed("", stops, span, frame)
            yield shot, scene if scene.time is None else scene.at(round(scene.time))
    yield stops[span[1]]


def mixed(name: Any, values: Mapping[int, Any], span: tuple[int, int], now: int) -> Any:
    """Return what is at a frame in a span: as at its start, but for numbers on the way to its end."""
    first = values[span[0]]
    values = {at: each for at, each in values.items() if kind_of(each) == kind_of(first)}
    if values.get(span[1], first) == first or name in ("channel", "within"):
        return first
    if is_number(first) or name in COLORS:
        return splined(name, values, now)
    made = {n: mixed(n, {at: parts_of(x)[n] for at, x in values.items()}, span, now) for n in parts_of(first)}
    if is_dataclass(first):
        return replace(first, **made)  # type: ignore[type-var]
    return type(first)(made.values()) if isinstance(first, list | tuple) else made or first


def parts_of(value: Any) -> dict[Any, Any]:
    """Return the parts of a value by name or number."""
    if isinstance(value, list | tuple):
        return dict(enumerate(value))
    return vars(value) if is_dataclass(value) else dict(value) if isinstance(value, Mapping) else {}


def kind_of(value: Any) -> Any:
    """Return what two values share that can be mixed: of lights their kind, of planes the normal."""
    parts = parts_of(value)
    return float if is_number(value) else (type(value), [*parts], parts.get("kind"), parts.get("normal"))


def splined(name: str, values: Mapping[int, Any], frame: int) -> Any:
    """Return a number or a colour at a frame, on a monotone cubic spline (Fritsch and Butland 1984)."""
    from scipy.interpolate import PchipInterpolator

    rows = np.array([*values.values()], float)
    if name in COLORS:
        rows = oklab(torch.from_numpy(rows)).numpy()
    rows = np.log(rows) if name == "radius" else np.unwrap(rows, period=360) if name == "azimuth" else rows
    here = PchipInterpolator([*values], rows)(frame).clip(rows.min(axis=0), rows.max(axis=0))  # it rounds
    if name in COLORS:
        return tuple(from_oklab(torch.from_numpy(here)).clamp(0, 1).tolist())
    return float(np.exp(here) if name == "radius" else here)
