"""Stage `timing`: how long a frame of the scene takes, beside one of the volume in the same minute."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from statistics import fmean, median
from typing import TYPE_CHECKING

from texgs.core.progress import progress
from texgs.report.results import TimingResult
from texgs.workflow.inputs import has_scene, scene_and_volume, scene_settings
from texgs.workflow.stage import EVERY, Outcome, Rule, Stage
from texgs.workflow.stages.settings import OfScene

if TYPE_CHECKING:
    from texgs.core.camera import Camera

WARM = 3  # frames before those that count
FRAMES, VOLUME_FRAMES = 61, 12  # spread over the path: more say the same; the volume's take long


def work(settings: OfScene, inputs: dict[str, Path], output: Path) -> Outcome:
    """Measure; nothing but the numbers is written.

    Args:
        settings: of the job.
        inputs: `scene`, the scene.yaml, and `volume`, the volume.nrrd, where there is one.
        output: folder.
    """
    import torch

    from texgs.core.device import torch_device
    from texgs.scene.scene_file import read_scene
    from texgs.volume.cameras import spiral, spread
    from texgs.workflow.stages.volume_scene import VolumeScene

    scene, views = read_scene(inputs["scene"]), settings.views
    path = spiral(max(2, views.test.count), *views.lens)
    composition = scene.open(torch_device(settings.fit.device))
    title = f"{settings.dataset}: timing"
    device = composition.device
    frames = milliseconds(
        lambda camera: composition.render(camera.to(device), scene.light, scene.edits),
        spread(path, FRAMES),
        title,
    )
    result = TimingResult(
        fmean(frames),
        max(frames),
        median(frames),
        len(composition),
        views.width,
        views.height,
        torch.get_num_threads(),
    )
    if "volume" in inputs:
        volume = VolumeScene(settings, inputs["volume"])
        of_volume = milliseconds(
            lambda camera: volume.render(camera, scene, composition.palettes),
            spread(path, VOLUME_FRAMES),
            f"{title}, volume",
        )
        result = replace(result, volume_mean_ms=fmean(of_volume), volume_max_ms=max(of_volume))
    return Outcome(result)


def milliseconds(render: Callable[[Camera], object], cameras: Sequence[Camera], title: str) -> list[float]:
    """Return milliseconds of each frame, the first ones not counted."""
    for camera in cameras[:WARM]:
        render(camera)
    settle()
    times = []
    for camera in progress(cameras, title=title, unit="frame"):
        start = time.perf_counter()
        render(camera)
        settle()
        times.append(1e3 * (time.perf_counter() - start))
    return times


def settle() -> None:
    """Wait for a GPU, where one is at work."""
    import torch

    if torch.cuda.is_initialized():
        torch.cuda.synchronize()


STAGE = Stage(
    "timing",
    order=140,
    help="measure how long frames of a scene and of its volume take",
    rule=Rule(
        "timing",
        "{dataset}/scene/{fit}/timing",
        target="scenes",
        threads=EVERY,  # other jobs would be measured with it
        gpu=("views", "fit"),
    ),
    schema=OfScene,
    select=scene_settings,
    inputs=scene_and_volume,
    work=work,
    applies=has_scene,
)
