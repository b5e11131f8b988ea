"""Stage `edit_metrics`: all that can be measured of an edited scene, and why the rest was not."""

from dataclasses import dataclass
from pathlib import Path

from texgs.config.fields import kinds
from texgs.config.methods import method_of
from texgs.config.views import ViewKeys
from texgs.core.device import torch_device
from texgs.edit.parts import parts_of
from texgs.metrics.metric import MeasuredScene, StyledModel, values_of
from texgs.report.results import EditMeasures
from texgs.scene.scene import Scene
from texgs.scene.scene_file import read_scene
from texgs.volume.cameras import spiral, spread
from texgs.workflow.stages.edit import Settings as EditSettings
from texgs.workflow.stages.outcome import Outcome


@dataclass
class Settings(EditSettings):
    """What the stage reads of the configuration."""

    compared: int
    clip: str
    views: ViewKeys


def work(settings: Settings, inputs: dict[str, Path], output: Path) -> Outcome:
    """Measure; nothing but the numbers is written.

    Args:
        settings: of the job.
        inputs: `scene`, edited, `before`, as fitted, and `geometry`, the scene whose depth is taken.
        output: folder.
    """
    edit, views, device = settings.edit, settings.views, torch_device(settings.fit.device)
    before, after = read_scene(inputs["before"]), read_scene(inputs["scene"])
    cameras = [camera.to(device) for camera in spiral(max(2, views.test.count), *views.lens)]
    measured = MeasuredScene(
        title=f"{settings.dataset}: {edit.name}",
        scenes=(before, after),
        compositions=(before.open(device), after.open(device, is_lean=True)),
        geometry_file=inputs["geometry"],
        cameras=cameras,
        some=spread(cameras, settings.compared),
        captions=(edit.source_caption, edit.target_caption),
        clip=settings.clip,
        weights=settings.weights,
        styles=styles_of(settings, after, max(cameras[0].width, cameras[0].height)),
        has_normals="normals" in kinds()[settings.fit.field].can,
    )
    values = values_of(measured)
    return Outcome(EditMeasures(edit.name, edit.method, views.width, views.height, values))


def styles_of(settings: Settings, scene: Scene, longest: int) -> list[StyledModel]:
    """Return the styles of models, `longest` pixels large; none of segments, words or several pictures."""
    edit = settings.edit
    parts, method = parts_of(scene, edit.parts), method_of(edit)
    if method.style is None or any(part.segment for part in parts):
        return []
    styles = []
    for part in parts:
        picture = method.style(method.of(edit, settings.followed.get(part.model)))
        if picture is None:
            return []
        style = picture.scaled(longest)
        styles.append(StyledModel(part.model, part.name, style.image, style.region))
    return styles
