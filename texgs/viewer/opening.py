"""What a viewer is started with: a scene file, a folder of results, or the file of one model."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from texgs.core.errors import ArgumentError
from texgs.core.names import SCENES, label
from texgs.scene.scene import Scene, SceneModel
from texgs.scene.scene_file import read_scene

SCENE = "scene.yaml"  # as jobs write it
OF_JOBS = "metrics.json"  # beside what a job wrote, and would write again
MOST_LISTED = 5


@dataclass(frozen=True)
class Opened:
    """A scene, and where its edits are saved."""

    scene: Scene
    title: str
    folder: Path
    name: str  # that a scene file gets unless another one is chosen
    file: Path | None = None  # of the scene, where edits may be written to it


def open_scene(path: Path, folder: Path | None = None) -> Opened:
    """Return the scene of a path.

    A scene that a job wrote is saved under another name in the current folder: jobs do not replace a folder
    that holds files of others.

    Args:
        path: scene.yaml, a folder with one of these in it or below, or a model file.
        folder: for saving; by default that of the scene or the model, or the current one.
    """
    if path.is_dir():
        path = only_scene(path)
    of_job = (path.parent / OF_JOBS).exists()
    folder = folder or (Path.cwd() if of_job else path.parent)
    if path.suffix in SCENES:
        name, file = ("edited.yaml", None) if of_job and path.name == SCENE else (path.name, path)
        return Opened(read_scene(path), title_of(path), folder, name, file)
    if not path.is_file():
        raise ArgumentError(f"{path}: no such scene, folder or model; texgs compose writes a scene")
    scene = Scene({label(str(path), path.stem): SceneModel(path)})
    return Opened(scene, title_of(path), folder, SCENE)


def only_scene(folder: Path) -> Path:
    """Return the scene file in a folder or below."""
    files = sorted(folder.rglob(SCENE))
    if len(files) != 1:
        some = ", ".join(str(each.relative_to(folder)) for each in files[:MOST_LISTED])
        more = ", ..." if len(files) > MOST_LISTED else ""
        got = f"{len(files)} ({some}{more}); name one of them" if files else "none; texgs compose writes one"
        raise ArgumentError(f"{folder}: expected one scene.yaml in this folder or below, got {got}")
    return files[0]


def title_of(path: Path) -> str:
    """Return enough of a path to know the scene by."""
    return "/".join(path.resolve().parts[-4:])
