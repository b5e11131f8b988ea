"""Files of a scene that a page saves: films, and what `texgs export` writes."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.core.keys import require_keys
from texgs.core.names import EXPORTS
from texgs.fields.files import kind_of
from texgs.fields.part_edit import EDIT_KEYS
from texgs.scene import export_keys
from texgs.scene.film import Film
from texgs.scene.keyframes import KEPT, keyed_shots
from texgs.scene.scene import Scene
from texgs.scene.session import SCENE_KEYS
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
    is_told = ending == ".ply" or kind == "textured"  # others have the same ending
    path = folder / (f"{name}-{kind}{ending}" if is_told else f"{name}{ending}")
    if kind in FILMS:
        for name in {name for key in asked.keys for name in key}:  # no page opens files of its choice
            require_keys({name.rpartition(".")[2]: None}, (*KEPT, *SCENE_KEYS, *EDIT_KEYS), "keys")
        view, film = replace(asked.view, transparent=False), Film(keys=[*asked.keys], fps=asked.fps)
        size = view.camera.width, view.camera.height
        keyed = keyed_shots(film.keys, scene, scene.open())
        seen = ((Orbit(x.target, x.azimuth, x.polar, x.radius, x.fov_y, *size), shown) for x, shown in keyed)
        frames = (pixels(replace(view, camera=camera), shown) for camera, shown in seen)
        return film.write(path, frames, checked, title="film"), []
    keys = export_keys.Export(kind, volume=volume, steps=asked.steps if kind == "html" else "all")
    return path, export(path, scene, keys, checked, title)


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
