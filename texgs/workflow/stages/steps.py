"""Stage `steps`: the scene of a data set followed through all steps of its series in time."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from texgs.core.memory import MIB
from texgs.core.names import SCENE
from texgs.core.progress import progress
from texgs.fields.kinds import kinds
from texgs.report.results import BELOW_WORDS, COMPARED_VIEWS, StepsResult
from texgs.volume.settings import VolumeKeys
from texgs.workflow.inputs import has_scene, is_series, scene_and_volume, without
from texgs.workflow.locate import series_files
from texgs.workflow.stage import Config, Outcome, Rule, Stage, read
from texgs.workflow.stages.settings import OfScene

if TYPE_CHECKING:
    import numpy as np
    import torch

    from texgs.core.lens import Lens
    from texgs.report.results import ViewComparison
    from texgs.scene.scene import Scene

STEP = "step."  # before the numbers of files among inputs
MEASURED, EVERY = 6, 10  # steps that are compared with their volumes: so many at least, and a tenth of all
FRAMES = 72  # of the film
SHOWN = "Steps of the series"


@dataclass(kw_only=True)
class Settings(OfScene):
    """What the stage reads of the configuration."""

    volume: VolumeKeys = read(lambda config: without(config.dataset.volume, "obtain"))


def work(settings: Settings, inputs: dict[str, Path], output: Path) -> Outcome:
    """Write scene.yaml with the files of all steps, steps.png and time.mp4.

    It reads `scene`, the scene.yaml of one step, with what it names, and `step.0` on, the files of all steps;
    one that has an axis of time, or none where steps are generated.
    """
    from texgs.core.check import torch_device
    from texgs.core.figures import write_grid
    from texgs.edit.series import make_series
    from texgs.report.compared import caption
    from texgs.scene.scene_file import read_scene

    device, is_whole = torch_device(settings.fit.device), not (output / "series.json").exists()
    files = [path for name, path in inputs.items() if name.startswith(STEP)]
    start = time.monotonic()
    file = make_series(read_scene(inputs["scene"]), files, output, device, settings.volume, settings.fit.seed)
    seconds = time.monotonic() - start
    scene = read_scene(file)
    steps, lens = len(scene.timeline.steps), settings.views.lens(scene.frame)
    measures, rows = measured(scene, lens, device, f"{settings.dataset}: steps")
    write_grid(output / "steps.png", rows, [caption(entry) for entry in measures])
    write_film(output / "time.mp4", scene, settings, device)
    size = sum(scene.timeline.model(name, 0).stat().st_size for name in scene.models) / MIB
    result = StepsResult(steps, COMPARED_VIEWS, size, measures, seconds / (steps - 1) if is_whole else None)
    return Outcome(result, {"steps.png": SHOWN + BELOW_WORDS})


def measured(
    scene: Scene, lens: Lens, device: torch.device, title: str
) -> tuple[list[ViewComparison], dict[str, list[np.ndarray]]]:
    """Return how close steps are to their volumes, and some pictures of them in rows."""
    import numpy as np

    from texgs.report.compared import POLAR, compare_views
    from texgs.scene.twin import Twin
    from texgs.volume.cameras import orbit_path

    names = scene.timeline.steps
    spread = np.linspace(0, len(names) - 1, max(MEASURED, len(names) // EVERY + 1))
    listed = sorted(set(spread.round().astype(int).tolist()))
    cameras, measures, rows = orbit_path(COMPARED_VIEWS, POLAR, lens), [], dict[str, list[np.ndarray]]()
    for step in progress(listed, len(listed), title=title, unit="step"):
        shown = scene.at(step)
        entry, pictures = compare_views(names[step], shown, shown.open(device), Twin(shown, device), cameras)
        measures.append(entry)
        for row, picture in pictures.items():
            rows.setdefault(row, []).append(picture)
    return measures, rows


def write_film(path: Path, scene: Scene, settings: Settings, device: torch.device) -> None:
    """Write a film of all steps, around which the camera turns."""
    from texgs.report.compared import POLAR
    from texgs.scene.film import Film, frames_of

    count = max(FRAMES, len(scene.timeline.steps))
    film, lens = Film(what="orbit-time", frames=count, polar=POLAR), settings.views.lens(scene.frame)
    shots = film.shots(scene, lens=lens.square(kinds()[settings.fit.field].film_size))
    film.write(path, frames_of(scene, shots, device), title=f"{settings.dataset}: film")


def inputs(config: Config) -> dict[str, Path]:
    """Return the scene of one step with all that it names, and the files of all steps."""
    steps = {f"{STEP}{number}": path for number, path in enumerate(series_files(config))}
    return {**scene_and_volume(config), **steps}


STAGE = Stage(
    "steps",
    order=125,
    help="follow a scene through the steps of its series in time",
    rule=Rule(
        "steps",
        "{dataset}/scene/{fit}/steps",
        (SCENE, "steps.png"),
        target="scenes",
        gpu=("fit",),
        shown={"steps.png": SHOWN + BELOW_WORDS},
    ),
    inputs=inputs,
    work=work,
    applies=lambda config: has_scene(config) and is_series(config),
)
