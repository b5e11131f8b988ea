"""Stage `timing`: how long a frame of the scene takes, beside one of the volume in the same minute."""

from dataclasses import replace
from functools import partial
from pathlib import Path
from statistics import fmean, median

from texgs.report.results import TimingResult
from texgs.workflow.inputs import has_scene, scene_and_volume
from texgs.workflow.stage import ALL_THREADS, Outcome, Rule, Stage
from texgs.workflow.stages.settings import OfScene

FRAMES = 61  # spread over the path: more say the same
VOLUME_FRAMES = 12  # spread over the path: they take long


def work(settings: OfScene, inputs: dict[str, Path], output: Path) -> Outcome:
    """Measure; nothing but the numbers is written.

    It reads `scene`, the scene.yaml, with what it names.
    """
    import torch

    from texgs.core.check import torch_device
    from texgs.metrics.edits.frame_times import milliseconds
    from texgs.scene.scene_file import read_scene
    from texgs.scene.twin import Twin
    from texgs.volume.cameras import spiral, spread

    scene, views = read_scene(inputs["scene"]), settings.views
    path = spiral(max(2, views.test.count), views.lens(scene.frame))
    device = torch_device(settings.fit.device)
    composition = scene.open(device)
    title = f"{settings.dataset}: timing"
    times = milliseconds(
        lambda camera: composition.render(camera.to(composition.device), scene.light, scene.edits),
        spread(path, FRAMES),
        title,
    )
    conditions = len(composition), views.width, views.height, torch.get_num_threads()
    result = TimingResult(fmean(times), max(times), median(times), *conditions)
    if scene.volume is not None:
        render = partial(Twin(scene, device).render, scene=scene, palettes=composition.palettes)
        times = milliseconds(render, spread(path, VOLUME_FRAMES), f"{title}, volume")
        result = replace(result, volume_mean_ms=fmean(times), volume_max_ms=max(times))
    return Outcome(result)


STAGE = Stage(
    "timing",
    order=140,
    help="measure how long frames of a scene and of its volume take",
    rule=Rule(
        "timing",
        "{dataset}/scene/{fit}/timing",
        target="scenes",
        threads=ALL_THREADS,  # other jobs would be measured with it
        gpu=("fit",),
    ),
    inputs=scene_and_volume,
    work=work,
    applies=has_scene,
)
