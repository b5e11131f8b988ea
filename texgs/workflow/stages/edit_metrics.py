"""Stage `edit_metrics`: what can be measured of an edited scene, and why the rest was not."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from statistics import fmean
from typing import TYPE_CHECKING, Any

from texgs.config.views import ViewKeys
from texgs.edit.method import methods
from texgs.fields.kinds import kinds
from texgs.report.results import EditMeasures
from texgs.workflow.inputs import view_settings, with_recipe
from texgs.workflow.places import made
from texgs.workflow.stage import EVERY, Outcome, Rule, Stage
from texgs.workflow.stages.edit import Settings as EditSettings
from texgs.workflow.stages.edit import edit_settings, edited_scene
from texgs.workflow.stages.timing import FRAMES, milliseconds

if TYPE_CHECKING:
    from omegaconf import DictConfig


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
    from texgs.core.device import torch_device
    from texgs.edit.measures import agreement, clip_numbers, is_geometry_kept, megabytes, style_distance
    from texgs.scene.scene_file import read_scene
    from texgs.volume.cameras import spiral, spread

    edit, views, weights = settings.edit, settings.views, settings.weights
    title, kind = f"{settings.dataset}: {edit.name}", kinds()[settings.fit.field]
    device = torch_device(settings.fit.device)
    after, before = read_scene(inputs["scene"]), read_scene(inputs["before"])
    scenes = after.open(device, is_lean=True), before.open(device)
    cameras = [camera.to(device) for camera in spiral(max(2, views.test.count), *views.lens)]
    some = spread(cameras, settings.compared)
    frames = milliseconds(
        lambda camera: scenes[0].render(camera, after.light, after.edits), spread(cameras, FRAMES), title
    )
    result = EditMeasures(
        edit.name,
        edit.method,
        fmean(frames),
        max(frames),
        len(scenes[0]),
        megabytes=megabytes(after),
        geometry_kept=is_geometry_kept(*scenes, some, "normals" in kind.can),
        width=views.width,
        height=views.height,
        **agreement(scenes[0], after, inputs["geometry"], cameras, settings.compared, weights),
        **style_distance(settings, after, some, device, title),
        **clip_numbers(settings, (after, before), scenes, cameras, title),
    )
    return Outcome(result)


def select(config: DictConfig) -> dict[str, Any]:
    """Return what the stage reads."""
    measures = {"compared": config.metric.views, "clip": config.metric.clip}
    return {**edit_settings(config), **measures, "views": view_settings(config)}


def inputs(config: DictConfig) -> dict[str, Path]:
    """Return the scene as edited and as fitted, what says where its surfaces are, and the views of all TFs.

    Where the experiment has several recipes, surfaces are those of its first, for all edits alike.
    """
    first = with_recipe(config, config.fits[0]) if config.fits else config
    scenes = {"scene": made("edit", config), "before": made("compose", config)}
    return {**edited_scene(config), **scenes, "geometry": made("compose", first)}


def applies(config: DictConfig) -> bool:
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
        threads=EVERY,  # it measures frames, too
        gpu=("fit",),
    ),
    schema=Settings,
    select=select,
    inputs=inputs,
    work=work,
    applies=applies,
)
