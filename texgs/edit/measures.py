"""Measures of an edited scene beside the one as fitted, for stage `edit_metrics`."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from math import isfinite
from pathlib import Path
from statistics import fmean
from typing import Any

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.memory import MIB
from texgs.core.progress import progress
from texgs.edit.method import method_of
from texgs.edit.parts import parts_of
from texgs.fields.field import Composed
from texgs.fields.kinds import kinds
from texgs.fields.surfels.texels import lean
from texgs.metrics.clip import clip_scores
from texgs.metrics.consistency import LONG, SHORT, consistency, frames_of
from texgs.metrics.style import likeness
from texgs.models.clip import Clip
from texgs.models.lpips import Lpips
from texgs.models.vgg import Vgg
from texgs.scene.scene import Scene
from texgs.scene.scene_file import read_scene


def megabytes(scene: Scene) -> float:
    """Of all models, as the paper's tables of edits count."""
    return sum(lean(entry.open()[0]).sizes()["files_mib"] for entry in scene.models.values()) * MIB / 1e6


@torch.no_grad()
def is_geometry_kept(after: Composed, before: Composed, cameras: Sequence[Camera], has_normals: bool) -> bool:
    """Whether depth, alpha and, where there are any, normals of all views are the same, bit for bit."""
    outputs = ("depth", "normal") if has_normals else ("depth",)
    pairs = [[scene.render(camera, outputs=outputs) for scene in (after, before)] for camera in cameras]
    return all(
        torch.equal(one.alpha, two.alpha)
        and torch.equal(one.depth, two.depth)  # type: ignore[arg-type]
        and (not has_normals or torch.equal(one.normal, two.normal))  # type: ignore[arg-type]
        for one, two in pairs
    )


def without_hidden(geometry: Scene, scene: Scene) -> Scene:
    """The models of the geometry but those that the scene hides; all of them where it hides everything."""
    hidden = {name for name, model in scene.models.items() if not model.edit.visible}
    shown = {name: model for name, model in geometry.models.items() if name not in hidden}
    return replace(geometry, models=shown or geometry.models)


@torch.no_grad()
def agreement(
    composition: Composed,
    scene: Scene,
    geometry: Path,
    cameras: Sequence[Camera],
    count: int,
    weights: Mapping[str, str | None],
) -> dict[str, Any]:
    """Consistency of views in the middle of the path, near and far, as they look with the scene's light.

    Fields that have light in their colours can be compared with others so. Nothing where no two views see the
    same, as of a scene that is nowhere opaque.
    """
    start = max(0, (len(cameras) - count - LONG) // 2)
    some = cameras[start : start + count + LONG]
    surfaces = without_hidden(read_scene(geometry), scene)
    depth = kinds()[next(iter(surfaces.models.values())).open()[0].kind].depth or "median"
    shown = surfaces.open(composition.device)
    frames = list(frames_of(composition, some, scene.light, scene.edits, shown, depth))
    perceptual = None
    if weights["vgg16"] and weights["lpips_vgg"]:
        perceptual = Lpips.load(device=composition.device).to
    apart = [each for each in (SHORT, LONG) if each < len(frames)]
    measures: dict[str, Any] = {}
    for each, measured in consistency(frames, apart, perceptual).items():
        name = "short" if each == SHORT else "long"
        measures |= {f"{name}_rmse": measured.rmse, f"{name}_lpips": measured.perceptual}
    return measures


def style_distance(
    settings: Any,
    scene: Scene,
    cameras: Sequence[Camera],
    device: torch.device,
    title: str,
) -> dict[str, Any]:
    """NNFM and Gram distances of the models with a style, means over them.

    None of segments, of looks by words or by several pictures, or where a model is nowhere opaque.
    """
    edit = settings.edit
    parts, method = parts_of(scene, edit.parts), method_of(edit)
    if method.style is None or any(part.segment for part in parts) or not settings.weights["vgg16"]:
        return {}
    vgg, likenesses = Vgg.load(device=device, dtype=torch.float32), []
    for part in parts:
        picture = method.style(method.of(edit, settings.followed.get(part.model)))
        if picture is None:
            return {}
        style = picture.scaled(max(cameras[0].width, cameras[0].height))
        likenesses.append(
            likeness(
                scene.models[part.model].open()[0].to(device),
                cameras,
                [scene.light] * len(cameras),
                style.image,
                vgg,
                style.region,
                f"{title}, {part.name}",
            )
        )
    means = {
        "style_nnfm": fmean(each.nnfm for each in likenesses),
        "style_gram": fmean(each.gram for each in likenesses),
    }
    return {name: value for name, value in means.items() if isfinite(value)}


@torch.no_grad()
def clip_numbers(
    settings: Any,
    scenes: tuple[Scene, Scene],
    compositions: tuple[Composed, Composed],
    cameras: Sequence[Camera],
    title: str,
) -> dict[str, Any]:
    """CLIP's similarity and directional similarity over all views, or why they were not measured."""
    edit, backbone = settings.edit, settings.clip
    if settings.weights[backbone] is None:
        return {"clip_missing": f"the weights of {backbone} are not on this machine"}
    if not edit.source_caption or not edit.target_caption:
        return {"clip_missing": "the edit has no captions"}
    clip = Clip.load(backbone, compositions[0].device)

    def views_of(scene: Scene, composition: Composed) -> Iterator[Tensor]:
        for camera in progress(cameras, title=f"{title}, CLIP", unit="view"):
            yield composition.render(camera, scene.light, scene.edits).color.clamp(0, 1)

    edited, originals = map(views_of, scenes, compositions)
    scores = clip_scores(clip, edited, originals, edit.source_caption, edit.target_caption)
    return {"clip": scores.backbone, "similarity": scores.similarity, "direction": scores.direction}
