"""Stage `compose`: the basic models of a data set as one scene."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from texgs.report.results import SceneResult
from texgs.workflow.inputs import all_models, has_scene
from texgs.workflow.stage import Outcome, Rule, Stage, read
from texgs.workflow.stages.settings import Distance, FitLabel, OfDataset

AZIMUTH, POLAR = -60.0, 20.0  # of the picture, degrees


@dataclass(kw_only=True)
class Settings(OfDataset):
    """What the stage reads of the configuration."""

    image: int = read("dataset.image")
    lens: Distance
    fit: FitLabel


def work(settings: Settings, inputs: dict[str, Path], output: Path) -> Outcome:
    """Write scene.yaml, in which nothing is edited, and scene.png.

    It reads model.safetensors of each basic TF, by its name.
    """
    from texgs.core.camera import orbit
    from texgs.core.check import torch_device
    from texgs.core.movie import write_frames
    from texgs.scene.frame import frame
    from texgs.scene.scene import Scene, SceneModel
    from texgs.scene.scene_file import write_scene

    scene = Scene({name: SceneModel(path) for name, path in inputs.items()})
    write_scene(output / "scene.yaml", scene)
    composition = scene.open(torch_device(settings.fit.device))
    camera = orbit(AZIMUTH, POLAR, *settings.lens.lens.square(settings.image))
    picture = frame(composition, camera, scene.light, scene.edits, background=scene.background)
    write_frames(output / "scene.png", [picture])
    return Outcome(SceneResult(len(scene.models), len(composition)))


STAGE = Stage(
    "compose",
    order=120,
    help="make one scene of the basic models of a data set",
    rule=Rule(
        "compose",
        "{dataset}/scene/{fit}/compose",
        ("scene.yaml", "scene.png"),
        target="scenes",
        gpu=("fit",),
        shown={"scene.png": "The basic models as one scene, rendered from their primitives."},
    ),
    schema=Settings,
    inputs=all_models,
    work=work,
    applies=has_scene,
)
