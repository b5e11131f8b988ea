"""Stage `compose`: the basic models of a data set as one scene."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from texgs.core.names import SCENE
from texgs.report.results import SceneResult
from texgs.volume.basic_tfs import basic_tfs_of
from texgs.volume.view_settings import Shading
from texgs.workflow.inputs import MODEL, has_scene, models_and_volume
from texgs.workflow.stage import Outcome, Rule, Stage, read
from texgs.workflow.stages.settings import FitLabel, OfVolume

if TYPE_CHECKING:
    from texgs.scene.scene import SceneVolume

SCENE_WORDS = "The scene as fitted."


@dataclass(kw_only=True)
class Settings(OfVolume):
    """What the stage reads of the configuration."""

    shading: Shading = read("views.shading")
    step: float = read("views.step")
    opacity_unit: float = read("views.opacity_unit")
    image: int = read("dataset.image")
    fov_y: float = read("views.fov_y")  # degrees
    framing: list[str] = read("dataset.framing")
    fit: FitLabel


def work(settings: Settings, inputs: dict[str, Path], output: Path) -> Outcome:
    """Write scene.yaml, in which nothing is edited, scene.png, and where there is a volume volume.png.

    It reads model.safetensors of each basic TF, and `volume`, the volume.nrrd, where there is one.
    """
    from texgs.core.check import torch_device
    from texgs.core.movie import write_frames
    from texgs.scene.frame import frame
    from texgs.scene.scene import Scene, SceneModel
    from texgs.scene.scene_file import write_scene
    from texgs.scene.shot import Shot
    from texgs.scene.twin import Twin
    from texgs.volume.framing import frame_of

    models = {
        name.removeprefix(MODEL): SceneModel(path) for name, path in inputs.items() if name.startswith(MODEL)
    }
    volume = volume_of(settings, inputs["volume"]) if "volume" in inputs else None
    scene = Scene(models, volume=volume)
    if volume is not None:
        framing = [tf for name, tf in volume.tfs.items() if name in settings.framing]
        grid = volume.open()
        scene = replace(scene, frame=frame_of(grid, framing), space=grid.world)
    write_scene(output / SCENE, scene)
    composition = scene.open(torch_device(settings.fit.device))
    shot = Shot(width=settings.image, fov_y=settings.fov_y)
    camera, pictures = shot.camera(scene.framed(composition)), {"scene.png": SCENE_WORDS}
    write_frames(output / "scene.png", [frame(composition, camera, scene)])
    if scene.volume is not None:
        pictures["volume.png"] = "The volume, by ray casting."
        truth = frame(composition, camera, scene, "volume", Twin(scene, composition.device))
        write_frames(output / "volume.png", [truth])
    return Outcome(SceneResult(len(scene.models), len(composition)), pictures)


def volume_of(settings: Settings, volume: Path) -> SceneVolume:
    """Return the volume with its basic TFs as views show it."""
    from texgs.scene.scene import SceneVolume
    from texgs.volume.nrrd_file import masks_in
    from texgs.volume.render import Appearance

    tfs = basic_tfs_of(volume, settings.basic_tfs, settings.tf_values)
    look = Appearance(**asdict(settings.shading), step=settings.step, opacity_unit=settings.opacity_unit)
    return SceneVolume(volume, tfs, look, tuple(masks_in(volume)))


STAGE = Stage(
    "compose",
    order=120,
    help="make one scene of the basic models of a data set",
    rule=Rule(
        "compose",
        "{dataset}/scene/{fit}/compose",
        (SCENE, "scene.png"),
        target="scenes",
        gpu=("fit",),
        shown={"scene.png": SCENE_WORDS},
    ),
    inputs=models_and_volume,
    work=work,
    applies=has_scene,
)
