"""Replace a transfer function on trial in a scene by a model fitted to it."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch

from texgs.core.errors import ArgumentError
from texgs.core.lens import Frame
from texgs.core.progress import let_stop
from texgs.fields.files import kind_of
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.model_file import write_model
from texgs.fitting.now import fit_now
from texgs.scene.scene import Scene, SceneModel, SceneVolume, volume_of
from texgs.scene.session import Session
from texgs.volume.caster import Caster
from texgs.volume.framing import frame_of
from texgs.volume.transfer import TransferFunction, overlapping

SIZE = 400  # pixels of either side of the views
FIRST_MODEL, FINER_MODEL = "model", "finer model"  # in titles of steps


def fit_function(
    session: Session,
    name: str,
    file: Callable[[], Path],
    device: torch.device | str = "cpu",
    size: int = SIZE,
    *,
    soon: bool = True,
) -> Iterator[str]:
    """Replace a function on trial by a quick model, then that by a finer one.

    Views show all of what the function shows, as the other models' views show theirs. Each model is a step of
    the session; yield its name, FIRST or FINER.

    Args:
        session: whose scene tries the function; it may be edited meanwhile.
        name: of the function, which becomes that of the model.
        file: returns the target of a model, once that is fitted.
        device: to fit on.
        size: of the views, pixels.
        soon: put the first model there, too; else the finer one alone.

    Raises:
        ArgumentError: if the scene tries no such function, names no volume or has other fields than surfels,
            nothing is to be seen, or what is replaced was changed meanwhile.
    """
    scene, given = session.scene, None
    volume, tf = volume_of(scene), tried_function(scene, name)
    for other, entry in scene.models.items():
        if (kind := kind_of(entry.file).name) != "surfels":
            raise ArgumentError(f"models.{other}: expected surfels, which a new model can join, got {kind}")
    frame = frame_of(volume.open(), [tf])
    models = models_of(volume, tf, frame, name, device, size)
    for model in models if soon else [*models][-1:]:
        let_stop(name)
        what = FINER_MODEL if given else FIRST_MODEL
        with session.one_step(f"{name} {what}"):
            require_unchanged(session.scene, name, tf, given)
            given = write_model(file(), model)
            session.set_scene(with_model(session.scene, name, given, tf))
        yield what


def models_of(
    volume: SceneVolume,
    tf: TransferFunction,
    frame: Frame,
    name: str,
    device: torch.device | str = "cpu",
    size: int = SIZE,
    **options: Any,
) -> Iterator[Surfels]:
    """Yield models of a volume under a function, in views of a frame; for options see `fit_now`."""
    caster = Caster(volume.open(), volume.appearance, device)
    lens = frame.lens(width=size, height=size)
    return fit_now(caster, volume.appearance, tf, lens, name, **options)


def require_unchanged(scene: Scene, name: str, tf: TransferFunction, given: Path | None) -> None:
    """Require that the function, or the model in a file, to be replaced is still in the scene."""
    entry = scene.models.get(name)
    if scene.functions.get(name) != tf if given is None else entry is None or entry.file != given:
        was = "first model" if given else "function"
        raise ArgumentError(f"{name}: its {was} was changed meanwhile; make the model again")


def tried_function(scene: Scene, name: str) -> TransferFunction:
    """Return a function on trial by name, and require that a model can replace it."""
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
    """Return the scene with a model of a function, which becomes a basic TF of its volume.

    A model of the name that is there gets the file, and keeps what is edited by numbers.
    """
    edit = scene.models[name].edit if name in scene.models else SceneModel(file).edit
    volume = volume_of(scene)
    volume = replace(volume, tfs={**volume.tfs, name: tf})
    functions = {other: each for other, each in scene.functions.items() if other != name}
    models = {**scene.models, name: SceneModel(file, edit)}
    return replace(scene, models=models, volume=volume, functions=functions)


def overlap_of(scene: Scene, name: str) -> str:
    """Return a sentence about basic TFs that overlap the function of a model, or ""."""
    tfs = scene.volume.tfs if scene.volume else {}
    others = [other for other in tfs if other != name and overlapping({name: tfs[name], other: tfs[other]})]
    if not others:
        return ""
    return (
        f" It shows values of {', '.join(others)} as well: models of both lie there, one over the other, "
        "where the volume adds their extinctions up."
    )
