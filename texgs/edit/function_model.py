"""A model of a transfer function that a scene tries on its volume, in place of the function."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import torch

from texgs.core.errors import ArgumentError
from texgs.fields.files import kind_of
from texgs.fields.surfels.model import Surfels
from texgs.fitting.now import fit_now
from texgs.scene.scene import Scene, SceneModel, volume_of
from texgs.volume.caster import Caster
from texgs.volume.framing import frame_of
from texgs.volume.nrrd_file import open_grid
from texgs.volume.transfer import TransferFunction, overlapping

SIZE = 400  # pixels of either side of the views


def models_of(
    scene: Scene, name: str, device: torch.device | str = "cpu", size: int = SIZE
) -> Iterator[Surfels]:
    """Yield a first model of a function that a scene tries, then a finer one.

    Views show all of what the function shows, as the other models' views show theirs.

    Raises:
        ArgumentError: if the scene tries no such function, names no volume or has other fields than surfels,
            or nothing is to be seen.
    """
    volume, tf = volume_of(scene), tried(scene, name)
    for other, entry in scene.models.items():
        if (kind := kind_of(entry.file).name) != "surfels":
            raise ArgumentError(f"models.{other}: expected surfels, which a new model can join, got {kind}")
    grid, look = open_grid(volume.file), volume.appearance
    lens = frame_of(grid, [tf]).lens(width=size, height=size)
    yield from fit_now(Caster(grid, look, device), look, tf, lens, name)


def tried(scene: Scene, name: str) -> TransferFunction:
    """Return the function of a name that a scene tries, and whose model can take its place."""
    if name not in scene.functions:
        known = ", ".join(scene.functions) or "none"
        raise ArgumentError(f"functions: expected one that the scene tries ({known}), got {name}")
    if scene.series is not None and name in scene.series.models:
        raise ArgumentError(
            f"functions: {name} has a model for each step of the series, which a model of one step cannot "
            "take the place of; give the function another name"
        )
    return scene.functions[name]


def with_model(scene: Scene, name: str, file: Path, tf: TransferFunction) -> Scene:
    """Return the scene with a model of a function, which is then a basic one of its volume.

    A model of the name that is there gets the file, and keeps what is edited by numbers.
    """
    edit = scene.models[name].edit if name in scene.models else SceneModel(file).edit
    volume = volume_of(scene)
    volume = replace(volume, tfs={**volume.tfs, name: tf})
    functions = {other: each for other, each in scene.functions.items() if other != name}
    models = {**scene.models, name: SceneModel(file, edit)}
    return replace(scene, models=models, volume=volume, functions=functions)


def overlap_of(scene: Scene, name: str) -> str:
    """Return what overlaps the function of a model means, in a sentence; nothing where none does."""
    tfs = scene.volume.tfs if scene.volume else {}
    others = [other for other in tfs if other != name and overlapping({name: tfs[name], other: tfs[other]})]
    if not others:
        return ""
    return (
        f" It shows values of {', '.join(others)} as well: models of both lie there, one over the other, "
        "where the volume adds their extinctions up."
    )
