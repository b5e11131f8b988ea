"""Stage `compose`: the basic models of a data set as one scene."""

from dataclasses import dataclass
from pathlib import Path

from texgs.core.camera import orbit
from texgs.core.device import torch_device
from texgs.core.movie import write_frames
from texgs.report.results import SceneResult
from texgs.scene.frame import frame
from texgs.scene.scene import Scene, SceneModel
from texgs.scene.scene_file import write_scene
from texgs.workflow.stages.outcome import Outcome
from texgs.workflow.stages.settings import Distance, FitLabel, OfDataset

SHOWN = "The basic models as one scene, rendered from their primitives."
AZIMUTH, POLAR = -60.0, 20.0  # of the picture, degrees


@dataclass
class Settings(OfDataset):
    """What the stage reads of the configuration."""

    image: int
    lens: Distance
    fit: FitLabel


def work(settings: Settings, inputs: dict[str, Path], output: Path) -> Outcome:
    """Write scene.yaml, in which nothing is edited, and scene.png.

    Args:
        settings: of the job.
        inputs: model.safetensors of each basic TF, by its name.
        output: folder.
    """
    scene = Scene({name: SceneModel(path) for name, path in inputs.items()})
    write_scene(output / "scene.yaml", scene)
    composition = scene.open(torch_device(settings.fit.device))
    camera = orbit(AZIMUTH, POLAR, *settings.lens.lens.square(settings.image))
    picture = frame(composition, camera, scene.light, scene.edits, background=scene.background)
    write_frames(output / "scene.png", [picture])
    return Outcome(SceneResult(len(scene.models), len(composition)), {"scene.png": SHOWN})
