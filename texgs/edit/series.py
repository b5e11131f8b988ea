"""Make a scene of a series in time: the models of a scene of one step, followed through the files of all."""

import filecmp
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

from texgs.core.cache import Checksums, digest
from texgs.core.errors import ArgumentError, errors_at
from texgs.core.io import read_json, write_json
from texgs.core.keys import typed
from texgs.core.names import METRICS, SCENE, natural_order
from texgs.core.plain_yaml import parse_yaml
from texgs.core.progress import progress
from texgs.fields.surfels.step_file import at_step, write_step
from texgs.fitting.series import Follower
from texgs.scene.scene import Scene, SceneModel, SceneVolume, volume_of
from texgs.scene.scene_file import write_scene
from texgs.scene.series_file import MAX_STEPS, Series, read_series, write_series
from texgs.volume.framing import shown_corners, smallest_ball
from texgs.volume.headers import NRRD
from texgs.volume.input_files import checksum_of_input
from texgs.volume.moments import Moment, in_time
from texgs.volume.nrrd_file import open_grid
from texgs.volume.settings import VolumeKeys, open_field, prepare_fields
from texgs.volume.summaries import write_summaries


def make_series(
    scene: Scene,
    files: Sequence[Path],
    folder: Path,
    device: torch.device,
    settings: VolumeKeys | None = None,
    seed: int = 0,
) -> Path:
    """Follow the models of a scene through a series of volumes, and write a scene of all steps.

    A single file or folder has all of them, along an axis of time; without files they are generated.

    The volumes are prepared as that of the scene was, which has to be one of them: its step is the one that
    models are followed from, on and back. What an earlier call has left in the folder is not made again.
    Settings say how volumes are read; by default the workflow's record beside the scene's volume does.

    The folder gets scene.yaml, series.json, and the volumes and models of steps. Files that are missing, on
    another lattice, or have changed since are refused, and a folder of another series.
    """
    volume = volume_of(scene)
    require_own_scene(folder)
    settings = settings or settings_of(volume.file)
    moments = moments_of(files, settings)
    series = Series(folder / "series.json", [moment.name for moment in moments], list(scene.models))
    if series.file.exists() and read_series(series.file) != series:
        raise ArgumentError(f"{folder}: expected a folder of these files, got one of others; choose another")
    write_series(series)
    prepare_steps(series, moments, settings, volume)
    steps = range(len(moments))
    same = (step for step in steps if filecmp.cmp(series.volume(step), volume.file, shallow=False))
    if (start := next(same, None)) is None:
        raise ArgumentError(f"steps: expected one of them to be the volume of the scene, {volume.file}")
    for name, entry in scene.models.items():
        with errors_at(f"models.{name}"):
            for order in (range(start, len(moments)), range(start, -1, -1)):
                follow(series, name, entry, volume, order, device, seed)
    seen = [shown_corners(open_grid(series.volume(step)), volume.tfs.values()) for step in steps]
    whole = replace(scene, series=series, frame=smallest_ball(np.concatenate(seen)))
    return write_scene(folder / SCENE, whole.at(start))


def moments_of(files: Sequence[Path], settings: VolumeKeys) -> list[Moment]:
    """Return the steps of several files or folders, of a folder of NRRD, or along one file's time axis.

    Without files, they are those of a generator.
    """
    if not files and settings.generator:
        return [Moment(f"step {time}", time=time) for time in range(settings.steps)]
    if len(files) == 1:
        only = files[0]
        inner = [each for each in only.iterdir() if each.suffix in NRRD] if only.is_dir() else []
        if inner:
            return in_time(sorted(inner, key=natural_order))
        with errors_at(only):
            count = open_field(replace(settings, time=0), only).n_steps
        if count > 1:
            return [Moment(f"{only.name}, step {time}", only, time) for time in range(count)]
    return in_time(files)


def prepare_steps(
    series: Series, moments: Sequence[Moment], settings: VolumeKeys, volume: SceneVolume
) -> None:
    """Prepare missing volumes with the settings of the scene's volume, and require its lattice."""
    grid, record, checksums = open_grid(volume.file), series.file.with_name("sources.json"), Checksums.load()
    made_of = read_json(record) if record.exists() else {}
    for step, moment in enumerate(progress(moments, title="volumes", unit="step")):
        target = series.volume(step)
        own = settings if moment.time is None else replace(settings, time=moment.time)
        read_as = f"Volume{str(own).removeprefix(type(own).__name__)}"  # the words in files of earlier series
        identity = digest(f"{read_as} {moment.file and checksum_of_input(moment.file, checksums)}")
        with errors_at(moment.name):
            if is_other := made_of.get(target.name) != identity:
                require_unfollowed(series, step)
            if is_other or not target.exists():
                target.unlink(missing_ok=True)
                write_json(record, made_of := {**made_of, target.name: identity})
                write_summaries(
                    target, prepare_fields(settings, [open_field(own, moment.file)], target), [""]
                )
            other = open_grid(target)
            if other.dims != grid.dims or not np.allclose(other.spacing, grid.spacing):
                raise ArgumentError(
                    f"expected {grid.dims} samples with spacing {grid.spacing} as of the scene's volume, got "
                    f"{other.dims} with {other.spacing}; resample the file, or say how that volume was read, "
                    "such as up=+z or reduce=2"
                )
    checksums.save()


def require_unfollowed(series: Series, step: int) -> None:
    """Require that a step without a volume has no models; they would belong to another volume."""
    for name in series.models:
        if (file := series.model(name, step)).exists():
            raise ArgumentError(
                f"{file} is of another volume: its file has changed, or was read in another way; remove "
                f"{file.parent}, or choose another folder"
            )


def require_own_scene(folder: Path) -> None:
    """Require that a scene in a folder belongs to a series; only then may it be replaced."""
    is_other = (folder / SCENE).exists() and not (folder / "series.json").exists()
    if is_other or (folder / METRICS).exists():
        what = "another scene" if is_other else "a result of the workflow"
        raise ArgumentError(f"{folder}: expected a folder for the series, got {what}; choose another")


def settings_of(file: Path) -> VolumeKeys:
    """Return the workflow's settings of a prepared volume, or defaults without a record."""
    facts = file.with_name(METRICS)
    if not facts.is_file():
        return VolumeKeys()
    record = file.resolve().parents[2] / ".conf" / f"volume-{read_json(facts).get('config_sha')}.yaml"
    if not record.is_file():
        return VolumeKeys()
    return replace(typed(VolumeKeys, parse_yaml(record.read_text(encoding="utf-8"))["volume"]), url=None)


def follow(
    series: Series,
    name: str,
    entry: SceneModel,
    volume: SceneVolume,
    order: range,
    device: torch.device,
    seed: int,
) -> None:
    """Make the missing files of a model's steps, beginning at its own step."""
    key = replace(entry, texture=None, segments={}, step=None).surfels()[0]
    model, follower, before = key, None, order[0]
    for step in order:
        file = series.model(name, step)
        if not file.exists():
            if step != order[0]:
                follower = follower or Follower(key.to(device), volume.appearance, volume.tfs[name])
                grids = [open_grid(series.volume(each)) for each in (before, step)]
                drawn = seed * MAX_STEPS + step  # a different one for each step
                title = f"{name}, step {step}"
                model = follower.step(model.to(device), grids[0], grids[1], title, drawn)
            write_step(file, key, model.to("cpu"), {"file": series.steps[step]})
        model, before = at_step(key, file), step
