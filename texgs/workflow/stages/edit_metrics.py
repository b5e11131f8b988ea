"""Stage `edit_metrics`: what can be measured of an edited scene, and why the rest was not."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from texgs.edit.method import method_of, methods
from texgs.report.results import EditMeasures
from texgs.volume.view_settings import ViewKeys
from texgs.workflow.edits import edited_scene
from texgs.workflow.inputs import fitted_scene, models_and_volume, view_settings, with_recipe
from texgs.workflow.stage import ALL_THREADS, Config, Outcome, Rule, Stage, read, result_file
from texgs.workflow.stages.settings import OfEdit

if TYPE_CHECKING:
    from texgs.metrics.metric import Style
    from texgs.scene.scene import Scene


@dataclass(kw_only=True)
class Settings(OfEdit):
    """What the stage reads of the configuration."""

    compared: int = read("metric.views")
    clip: str = read("metric.clip")
    views: ViewKeys = read(view_settings)


def work(settings: Settings, inputs: dict[str, Path], output: Path) -> Outcome:
    """Measure; nothing but the numbers is written.

    It reads `scene`, edited, `before`, as fitted, with its volume, and `geometry`, whose depth is taken.
    """
    from texgs.core.check import torch_device
    from texgs.metrics.metric import MeasuredScene, values_of
    from texgs.scene.film import COUNTS
    from texgs.scene.scene_file import read_scene
    from texgs.volume.cameras import spiral

    edit, views, device = settings.edit, settings.views, torch_device(settings.fit.device)
    before, after = read_scene(inputs["before"]), read_scene(inputs["scene"])
    path = spiral(COUNTS["test"], views.lens(before.frame))  # near and far along it are angles
    cameras = [camera.to(device) for camera in path]
    measured = MeasuredScene(
        title=f"{settings.dataset}: {edit.name}",
        scenes=(before, after),
        compositions=(before.open(device), after.open(device, is_lean=True)),
        geometry_file=inputs["geometry"],
        cameras=cameras,
        compared=settings.compared,
        captions=(edit.source_caption, edit.target_caption),
        clip=settings.clip,
        weights=settings.weights,
        styles=styles_of(settings, after, max(cameras[0].width, cameras[0].height)),
    )
    return Outcome(EditMeasures(edit.name, edit.method, views.width, views.height, values_of(measured)))


def styles_of(settings: Settings, scene: Scene, longest: int) -> list[Style]:
    """Return the picture that all follow, or one a model, `longest` pixels large; none of segments."""
    from texgs.edit.task import parts_of
    from texgs.metrics.metric import Style

    edit = settings.edit
    parts, method = parts_of(scene, edit.parts), method_of(edit)
    if any(part not in scene.models for part in parts):
        return []
    looks = {part: settings.followed.get(part) for part in parts}
    is_one = len(set(looks.values())) == 1 and set(parts) == set(scene.models)
    styles = []
    for part in parts[:1] if is_one else parts:
        picture = method.of(edit, looks[part]).picture()
        if picture is None:
            return []
        style = picture.scaled(longest)
        styles.append(Style(None if is_one else part, style.image, style.region))
    return styles


def inputs(config: Config) -> dict[str, Path]:
    """Return the scene as edited and as fitted, its surfaces and its volume, and the views of all TFs.

    Where the experiment has several recipes, surfaces are those of its first, for all edits alike.
    """
    first = with_recipe(config, config.fits[0]) if config.fits else config
    scenes = {"scene": result_file("edit", config), "before": fitted_scene(config)}
    of_scene = {**edited_scene(config), **models_and_volume(config), **scenes}
    return {**of_scene, "geometry": result_file("compose", first)}


def applies(config: Config) -> bool:
    """Return whether the configuration is of an edit that makes the scene look different."""
    method = methods().get(config.edit.method)
    return config.tf is None and method is not None and method.is_look


STAGE = Stage(
    "edit_metrics",
    order=180,
    help="measure an edited scene: CLIP, style, consistency, time, size",
    rule=Rule(
        "edit_metrics",
        "{dataset}/scene/{fit}/edit_metrics/{edit}",
        target="edits",
        threads=ALL_THREADS,  # it measures frames, too
        gpu=("fit",),
        swept=True,
    ),
    inputs=inputs,
    work=work,
    applies=applies,
)
