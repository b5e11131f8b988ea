"""Files of a scene that a page saves: films, and what `texgs export` writes."""

from collections.abc import Callable
from dataclasses import replace
from math import exp, log
from pathlib import Path

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.core.names import EXPORTS
from texgs.fields.files import kind_of
from texgs.scene import export_keys
from texgs.scene.film import Film
from texgs.scene.scene import Scene
from texgs.viewer import PAGE_VOLUME
from texgs.viewer.export import export
from texgs.viewer.messages import Export, Orbit, View

FILMS = ("mp4", "gif")


def write_download(
    folder: Path,
    scene: Scene,
    asked: Export,
    name: str,
    title: str,
    checked: str,
    pixels: Callable[[View, Scene], np.ndarray],
) -> tuple[Path, list[str]]:
    """Write a scene as it is shown, and return the file and notes on it.

    Args:
        folder: where to.
        scene: to write.
        asked: what, and how.
        name: of the file, without its ending.
        title: of a page.
        checked: what `texgs check` has found of the scene.
        pixels: draws a view of a scene, for films.
    """
    require_kind(scene, asked.kind)
    kind, volume = ("html", PAGE_VOLUME) if asked.kind == "volume" else (asked.kind, None)
    ending = EXPORTS.get(kind, [f".{kind}"])[0]
    path = folder / (f"{name}-{kind}{ending}" if ending == ".ply" else f"{name}{ending}")  # kinds share .ply
    if kind in FILMS:
        view = replace(asked.view, transparent=False)
        frames = (pixels(replace(view, camera=each), scene) for each in way_of(asked))
        return film_of(asked).write(path, frames, checked, title="film"), []
    keys = export_keys.Export(kind, volume=volume, steps=asked.steps if kind == "html" else "all")
    return path, export(path, scene, keys, checked, title)


def film_of(asked: Export) -> Film:
    """Return how long a film is."""
    return Film(seconds=asked.seconds, fps=asked.fps)


def way_of(asked: Export) -> list[Orbit]:
    """Return the cameras of a film: one turn from its view on, or a smooth way through its stops."""
    from scipy.interpolate import PchipInterpolator

    start, count = asked.view.camera, film_of(asked).count
    if len(asked.stops) < 2:
        return [replace(start, azimuth=start.azimuth + 360 * index / count) for index in range(count)]
    stops = np.array([[s.azimuth, s.polar, log(s.distance), s.fov_y, *s.target] for s in asked.stops])
    stops[:, 0] = np.unwrap(stops[:, 0], period=360)
    way = PchipInterpolator(range(len(stops)), stops)  # it stays between two stops: no pole is passed
    places = way(np.linspace(0, len(stops) - 1, count)).round(9).tolist()
    return [
        Orbit(tuple(target), azimuth, polar, exp(distance), fov_y, start.width, start.height)
        for azimuth, polar, distance, fov_y, *target in places
    ]


def exports_of(scene: Scene) -> list[str]:
    """Return what a scene can be written as."""
    kind = kind_of(next(iter(scene.models.values())).file)
    able = [*FILMS, *(each for each in kind.exports if each not in export_keys.MODEL_KINDS)]
    return [*able, "volume"] if "html" in able and scene.volume is not None else able


def require_kind(scene: Scene, kind: str) -> None:
    """Require that a scene can be written as something."""
    able = exports_of(scene)
    if kind not in able:
        raise ArgumentError(f"export: expected one of {', '.join(able)}, got {kind!r:.100}")
