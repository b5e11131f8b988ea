"""Make a scene of a series in time: the models of a scene of one step, followed through the files of all."""

from __future__ import annotations

import filecmp
import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from os.path import commonpath
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch

from texgs.config.dataset import Volume
from texgs.core.errors import ArgumentError, located
from texgs.core.io import read_json
from texgs.core.keys import typed
from texgs.core.names import natural_order
from texgs.core.plain_yaml import parse_yaml
from texgs.core.progress import progress
from texgs.fields.surfels.step_file import at_step, write_step
from texgs.fitting.series import Follower
from texgs.scene.scene import Scene, SceneModel
from texgs.scene.scene_file import write_scene
from texgs.scene.series_file import Series, read_series, write_series
from texgs.scene.twin import SceneVolume, volume_of
from texgs.volume.framing import shown_corners, smallest_ball
from texgs.volume.headers import NRRD
from texgs.volume.nrrd_file import open_grid
from texgs.workflow.stages.volume import prepared, source

NUMBER = re.compile(r"\d+(?=\D*$)")


class Moment(NamedTuple):
    """Where the volume of a step comes from: a file or folder, or a step of its axis of time."""

    name: str  # what the step is called
    file: Path
    time: int | None = None


def make_series(scene: Scene, files: Sequence[Path], folder: Path, device: torch.device) -> Path:
    """Follow the models of a scene through a series of volumes, and write a scene of all steps.

    A single file or folder has all of them, along an axis of time.

    The volumes are prepared as that of the scene was, which has to be one of them: its step is the one that
    models are followed from, on and back. What an earlier call has left in the folder is not made again.

    The folder gets scene.yaml, series.json, and the volumes and models of steps. Files that are missing or on
    another lattice are refused, and a folder of another series.
    """
    volume = volume_of(scene)
    settings = settings_of(volume.file)
    moments = moments_of(files, settings)
    series = Series(folder / "series.json", [moment.name for moment in moments], list(scene.models))
    if series.file.exists() and read_series(series.file) != series:
        raise ArgumentError(f"{folder}: expected a folder of these files, got one of others; choose another")
    write_series(series)
    prepare_steps(series, moments, settings, volume)
    steps = range(len(moments))
    same = (step for step in steps if filecmp.cmp(series.volume(step), volume.file, shallow=False))
    if (start := next(same, None)) is None:
        raise ArgumentError(f"--files: expected one of them to be the volume of the scene, {volume.file}")
    for name, entry in scene.models.items():
        with located(f"models.{name}"):
            for order in (range(start, len(moments)), range(start, -1, -1)):
                follow(series, name, entry, volume, order, device)
    seen = [shown_corners(open_grid(series.volume(step)), volume.tfs.values()) for step in steps]
    whole = replace(scene, series=series, frame=smallest_ball(np.concatenate(seen)))
    return write_scene(folder / "scene.yaml", whole.at(start))


def moments_of(files: Sequence[Path], settings: Volume) -> list[Moment]:
    """Return the steps of several files or folders, or of one: of a folder of NRRD, or along its own time."""
    if len(files) == 1:
        only = files[0]
        inner = [each for each in only.iterdir() if each.suffix in NRRD] if only.is_dir() else []
        if inner:
            return in_time(sorted(inner, key=natural_order))
        with located(only):
            count = source(replace(settings, time=0), only).n_steps
        if count > 1:
            return [Moment(f"{only.name}, step {time}", only, time) for time in range(count)]
    return in_time(files)


def in_time(files: Sequence[Path]) -> list[Moment]:
    """Return the steps of several files, in the order of their numbers where all have one.

    Numbers that are multiples of their least distance count steps, of which none may be missing; others are
    dates, say.
    """
    if len(files) < 2:
        got = ", ".join(map(str, files)) or "none"
        raise ArgumentError(f"--files: expected two files at least, got {got}; 'step_*.nrrd' names several")
    paths = [file.absolute() for file in files]
    base = commonpath([path.parent for path in paths])
    moments = [
        Moment(path.relative_to(base).as_posix(), file) for path, file in zip(paths, files, strict=True)
    ]
    if None in map(number_of, moments):
        return moments
    moments.sort(key=lambda moment: natural_order(Path(moment.name)))
    gaps = [(number_of(after) or 0) - (number_of(before) or 0) for before, after in pairwise(moments)]
    least = min(gaps)
    is_count = least > 0 and all(gap % least == 0 for gap in gaps)
    for (before, after), gap in zip(pairwise(moments), gaps, strict=True):
        if is_count and gap > least:
            raise ArgumentError(
                f"--files: expected a file each {least}, got none between {before.name} and {after.name}; "
                "name the files of one part of the series"
            )
    return moments


def number_of(moment: Moment) -> int | None:
    """Return the last number in the name of a step, without what tells its format."""
    found = NUMBER.search(str(Path(moment.name).with_suffix("")))
    return int(found[0]) if found else None


def prepare_steps(series: Series, moments: Sequence[Moment], settings: Volume, volume: SceneVolume) -> None:
    """Prepare the volumes that are missing, as that of the scene was, and require its lattice."""
    grid = open_grid(volume.file)
    for step, moment in enumerate(progress(moments, title="volumes", unit="step")):
        target = series.volume(step)
        with located(moment.name):
            if not target.exists():
                own = settings if moment.time is None else replace(settings, time=moment.time)
                prepared(settings, source(own, moment.file), target)
            other = open_grid(target)
            if other.dims != grid.dims or not np.allclose(other.spacing, grid.spacing):
                raise ArgumentError(
                    f"expected {grid.dims} samples with spacing {grid.spacing} as of the scene's volume, got "
                    f"{other.dims} with {other.spacing}; resample the file"
                )


def settings_of(file: Path) -> Volume:
    """Return how the workflow has read and prepared a volume; plainly, where it was not the workflow."""
    facts = file.with_name("metrics.json")
    sha = read_json(facts).get("config_sha") if facts.is_file() else None
    record = file.resolve().parents[2] / ".conf" / f"volume-{sha}.yaml"
    if not record.is_file():
        return Volume()
    return replace(typed(Volume, parse_yaml(record.read_text(encoding="utf-8"))["volume"]), url=None)


def follow(
    series: Series, name: str, entry: SceneModel, volume: SceneVolume, order: range, device: torch.device
) -> None:
    """Make the files of a model's steps that are missing, in an order that begins with its own step."""
    key = replace(entry, texture=None, segments={}, step=None).surfels()[0]
    model, follower, before = key, None, order[0]
    for step in order:
        file = series.model(name, step)
        if not file.exists():
            if step != order[0]:
                follower = follower or Follower(key.to(device), volume.appearance, volume.tfs[name])
                grids = [open_grid(series.volume(each)) for each in (before, step)]
                model = follower.step(model.to(device), grids[0], grids[1], f"{name}, step {step}", step)
            write_step(file, key, model.to("cpu"), {"file": series.steps[step]})
        model, before = at_step(key, file), step
