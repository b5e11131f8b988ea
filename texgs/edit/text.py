"""Text-driven editing: a guidance edits a few views of a model once, and its texels follow them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.core.light import HEADLIGHT, Light
from texgs.core.memory import require_memory
from texgs.edit.axis_views import axis_cameras, nearest_to_axes
from texgs.edit.canvas import require_editable
from texgs.edit.observations import LinearObservation, observe, render_views
from texgs.edit.texel_solver import back_project, fill_unseen, learn, seen_texels, solve
from texgs.fields.optimizer import Rate
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.texels import bare_colors, owners, recolored
from texgs.models.guidance import EditViews, Guidance, require_edited
from texgs.models.instruction import require_instruction

SIZE = 512  # pixels along the longer side of the views: what InstructPix2Pix was trained on
PIXEL = 112  # bytes of memory for a pixel of a view: what the guidance sees, returns, and texels follow
SURFEL = 28  # and for a surfel in a view at one opacity


@dataclass(frozen=True)
class TextRecipe:
    """Which views are edited, and how texels follow; the defaults are those of `default`."""

    views: Literal["axes", "nearest", "all"] = "axes"
    """Six new ones along the axes, filled by the scene; six training views nearest to the axes; or all."""
    opacities: tuple[float, ...] = (2.0, 1.0, 0.5)  # factors on the scene's opacity while texels are found
    sweeps: int = 3  # of the solver, where there are no iterations
    iterations: int = 0  # of Adam, over which opacities follow each other; 0: solve
    rate: float = 0.025  # of Adam at the start
    final: float = 0.1  # at the end, relative to that


RECIPES = {
    # One edit of six views; texels are the solution of a linear problem.
    "default": TextRecipe(),
    # One edit of six training views; texels by 1,500 iterations while the opacity falls, as in the paper.
    "paper": TextRecipe("nearest", opacities=(2.0, 1.5, 1.0, 0.75, 0.5), iterations=1500, final=1.0),
}


class Edited(NamedTuple):
    """What an edit gives."""

    model: Surfels  # with new texels and offsets of surfels; the rest stays as it was, bit for bit
    views: EditViews  # as the guidance saw them
    images: Tensor  # [V, H, W, 3] as the guidance edited them
    seen: float  # share of the texels that may change that edited views show; others are made up


def edit_by_text(
    model: Surfels,
    cameras: Sequence[Camera],
    guidance: Guidance,
    instruction: str,
    recipe: TextRecipe = RECIPES["default"],
    *,
    light: Light = HEADLIGHT,
    surfels: Tensor | None = None,
    size: int = SIZE,
    seed: int = 0,
    title: str = "text",
) -> Edited:
    """Restyle a model by an instruction (the paper's sections Text-Driven NPSE and Text prompt refinement).

    Geometry, material, lighting and palette stay as they are: views of any angle agree, however the
    edits differ. The model may be the result of an edit: its views show that (text prompt refinement). The
    opacity factors of the recipe are those of the search only; the model keeps its own.

    Args:
        model: textured.
        cameras: of the training views, on the model's device; new views are made from as far as the first.
        guidance: edits views, which show light as it wants; texels make up for it, or it falls on them
            afterwards.
        instruction: such as "as a stipple drawing".
        recipe: which views are edited, and how texels follow.
        light: that shines on the scene while it is edited.
        surfels: [N] bool, which may change; all by default. Others keep their colours bit for bit.
        size: pixels along the longer side of the six views; all training views are edited as they are.
        seed: of all random numbers; with the same one, machine and versions, results are the same.
        title: of progress bars.
    """
    require_editable(model, surfels)
    instruction = require_instruction(instruction)
    changing = torch.ones(len(model), dtype=torch.bool) if surfels is None else surfels
    changing, shine = changing.to(model.device), light if guidance.lit else None
    generator = torch.Generator().manual_seed(seed)
    cameras = edited_cameras(recipe, cameras, model.parameters["means"], size)
    pixels = cameras[0].width * cameras[0].height
    needed = len(cameras) * (PIXEL * pixels + SURFEL * len(recipe.opacities) * len(model))
    require_memory(needed, f"{len(cameras)} views that are edited", "edit fewer views, or smaller ones")
    views = render_views(model, cameras, shine)
    edited = require_edited(guidance(views, instruction, generator), views, guidance.name)
    rows = observe(model, views, edited, shine, recipe.opacities, changing)
    colors, weights = _follow(rows, model, recipe, generator, title)
    share = _seen_share(weights, model, changing)
    return Edited(recolored(model, colors, changing), views, edited, share)


def edited_cameras(
    recipe: TextRecipe, cameras: Sequence[Camera], means: Tensor, size: int
) -> Sequence[Camera]:
    """Return the cameras of the views to edit, from those of the training views; see `edit_by_text`."""
    if recipe.views == "all":
        return cameras
    if recipe.views == "nearest":
        return [camera.resized(size) for camera in nearest_to_axes(cameras, means).values()]
    return list(axis_cameras(cameras[0].resized(size), means).values())


def _follow(
    rows: list[list[LinearObservation]],
    model: Surfels,
    recipe: TextRecipe,
    generator: torch.Generator,
    title: str,
) -> tuple[Tensor, Tensor]:
    """Return bare colours [T, 3], made up where nothing is seen, and how much each texel is seen [T]."""
    observations = [observation for row in rows for observation in row]
    sums = back_project(observations, model)
    if recipe.iterations:
        rate, start = Rate(recipe.rate, recipe.final), bare_colors(model).clamp(0, 1)
        steps = recipe.iterations
        learned = learn(rows, start, rate=rate, steps=steps, generator=generator, title=title)
        return fill_unseen(learned, sums.weights, model), sums.weights
    start = fill_unseen(sums.colors, sums.weights, model)
    sweeps = recipe.sweeps
    colors = solve(observations, sums.curvature, start, sweeps=sweeps, generator=generator, title=title)
    return colors, sums.weights


def _seen_share(weights: Tensor, model: Surfels, changing: Tensor) -> float:
    """Return the share of the texels of some surfels [N] that is seen."""
    place, surfel = owners(model.parameters)
    mine = torch.zeros(len(weights), dtype=torch.bool, device=weights.device)
    mine[place] = changing[surfel]
    share = float(seen_texels(weights)[mine].double().mean())
    if share == 0:
        raise ArgumentError(
            "views: expected some that show what is to change, got none; choose other views "
            "(edit.text.views), or edit something that is less faint"
        )
    return share
