"""A scene of a volume: the workflow of a data set, in this process and without a project."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from filecmp import cmp
from numbers import Integral
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from texgs.api.functions import AnyFunctions, named
from texgs.api.scene import Scene
from texgs.api.volume import Volume
from texgs.core.check import torch_device
from texgs.core.errors import ArgumentError
from texgs.core.io import copy_atomic
from texgs.core.names import SCENE, close, file_name
from texgs.core.progress import interrupts_between_items
from texgs.scene.session import Session
from texgs.volume.summaries import summary_file, write_summaries
from texgs.volume.transfer import TransferFunction

if TYPE_CHECKING:
    from texgs.config.schema import Config

NOW = "now"
TEST_VIEWS = 12  # for the numbers of a fit; `Scene.psnr` measures more
LEAST_SIZE = 16  # pixels


@interrupts_between_items()
def fit(
    volume: Volume,
    functions: AnyFunctions | None = None,
    recipe: str = "quick",
    *,
    size: int = 400,
    seed: int = 0,
    device: str = "cpu",
    overrides: Sequence[str] = (),
    folder: str | Path | None = None,
) -> Scene:
    """Fit a basic model for each transfer function, and return them as a scene.

    Args:
        volume: to fit.
        functions: basic transfer functions, by name or in order, whose ranges do not overlap; default those
            suggested. With the recipe `now` ranges may overlap.
        recipe: "now" (about a minute a function), "quick", "default", "paper" or another file of conf/fit.
        size: of the views, pixels.
        seed: of all random numbers.
        device: "cpu" or "cuda".
        overrides: more keys of the configuration, such as "views.train.frequency=3"; not for `now`.
        folder: for all files, a copy of the volume too. A fit that was interrupted goes on there, and one
            that is done is opened; `now` begins anew. Default: one that is gone with the scene.

    Raises:
        ArgumentError: if functions overlap, a key or a recipe is unknown, or nothing is visible.
    """
    from texgs.config.project import members

    if not isinstance(volume, Volume):
        raise ArgumentError(f"volume: expected a texgs.Volume, got {type(volume).__name__}")
    if not isinstance(size, Integral) or size < LEAST_SIZE:
        raise ArgumentError(f"size: expected a whole number of pixels, at least {LEAST_SIZE}, got {size!r}")
    if not isinstance(seed, Integral) or not 0 <= seed < 2**63:
        raise ArgumentError(f"seed: expected a whole number from 0 on, got {seed!r}")
    recipes = [NOW, *members("fit")]
    if recipe not in recipes:
        known, hint = ", ".join(recipes), close(recipe, recipes)
        raise ArgumentError(f"recipe: expected one of {known}, got {recipe}{hint}")
    if isinstance(overrides, str) or not all(isinstance(each, str) for each in overrides):
        raise ArgumentError(
            f"overrides: expected a list of words such as 'views.width=400', got {overrides!r}"
        )
    if recipe == NOW and overrides:
        raise ArgumentError(f"overrides: not for the recipe {NOW}; leave them out")
    torch_device(device)
    tfs = named(volume.suggest() if functions is None else functions)
    kept = TemporaryDirectory(prefix="texgs-") if folder is None else folder
    place = Path(kept.name if isinstance(kept, TemporaryDirectory) else kept)
    if recipe == NOW:
        file = fit_now_into(volume, tfs, size, seed, device, place)
    else:
        words = (f"fit={recipe}", f"device={device}", f"views.width={size}", f"views.height={size}")
        file = compose_in(volume, tfs, (*words, f"fit.seed={seed}", *overrides), place)
    return Scene(Session.open(file, device), volume, kept)


def fit_now_into(
    volume: Volume, functions: Mapping[str, TransferFunction], size: int, seed: int, device: str, folder: Path
) -> Path:
    """Fit models in memory, and write them and a scene into a folder; return the scene's file."""
    from texgs.edit.function_model import models_of
    from texgs.fields.surfels.model_file import write_model
    from texgs.scene.scene import Scene as Models
    from texgs.scene.scene import SceneModel, SceneVolume
    from texgs.scene.scene_file import write_scene
    from texgs.volume.framing import frame_of
    from texgs.volume.nrrd_file import masks_in

    files = {name: folder / file_name("functions", f"{name}.safetensors") for name in functions}
    if (folder / SCENE).exists():
        warnings.warn(f"{folder} holds a scene, which this replaces; another folder keeps both", stacklevel=3)
    file, frame = copied(volume, folder), frame_of(volume.grid, functions.values())
    made_of = SceneVolume(file, functions, labels=tuple(masks_in(file)))
    models = {}
    for name, tf in functions.items():
        (model,) = models_of(made_of, tf, frame, name, device, size, seed=seed, soon=False)
        models[name] = SceneModel(write_model(files[name], model))
    return write_scene(folder / SCENE, Models(models, volume=made_of, frame=frame, space=volume.grid.world))


def compose_in(
    volume: Volume, functions: Mapping[str, TransferFunction], words: tuple[str, ...], folder: Path
) -> Path:
    """Run the stages up to the scene with results in a folder; return the scene's file."""
    from texgs.workflow.execution import Task, ensure
    from texgs.workflow.stage import result_file
    from texgs.workflow.stage_table import STAGES, jobs

    config = configuration(volume, functions, words, folder)
    known = {stage.output(each): Task(stage, each) for stage, each in jobs(config)}
    ensure(STAGES["compose"], config, known, tell=lambda line: None, warn=warnings.warn)
    return result_file("compose", config)


def configuration(
    volume: Volume, functions: Mapping[str, TransferFunction], words: tuple[str, ...], folder: Path
) -> Config:
    """Return the configuration of a data set that is a volume with basic transfer functions."""
    from texgs.config.compose import recompose
    from texgs.config.dataset import dataset_of
    from texgs.config.project import check_name
    from texgs.volume.basic_tfs import basic_tf_of
    from texgs.volume.transfer import check_disjoint

    check_disjoint(functions)
    if taken := [word for word in words if word.lstrip("+~").startswith(("dataset", "results"))]:
        raise ArgumentError(
            f"overrides: expected keys of views, fit and metric, got {', '.join(taken)}; leave them out: the "
            "volume and folder= say these"
        )
    for name in (volume.name, *functions):
        check_name("name", name)
    few = (f"views.test.count={TEST_VIEWS}", f"views.relit={TEST_VIEWS}", "views.turntable=1")
    config = recompose(("tracking=none", "edit=none", *few, "metric.vtk_frames=0", *words))
    basic = {name: basic_tf_of(tf, [*volume.channels]) for name, tf in functions.items()}
    file = copied(volume, folder).resolve()
    has_image = "" in volume.channels
    labels = str(file) if has_image and len(volume.channels) > 1 else None
    kind = "image" if has_image else "labels"
    dataset = dataset_of(volume.name, file, basic, kind=kind, labels=labels)
    return replace(config, dataset=dataset, results=str(folder))


def copied(volume: Volume, folder: Path) -> Path:
    """Return a copy of the volume in a folder, for later processes."""
    file = folder / file_name("volume.name", f"{volume.name}.nrrd")
    if not file.exists() and not summary_file(file).exists():
        copy_atomic(volume.file, file)
    elif not (file.is_file() and cmp(file, volume.file, shallow=False)):
        raise ArgumentError(
            f"folder: expected one without another {file.name} or {summary_file(file).name}, got {folder}; "
            "choose another folder, or another name= of the volume"
        )
    write_summaries(file, [*volume.channels.values()], [*volume.channels])
    return file
