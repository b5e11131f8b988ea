"""Text-driven editing: a guidance edits a few views of a model once, and its texels follow them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, get_args

import torch
from torch import Tensor

from texgs.core import check
from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.core.light import HEADLIGHT, Light
from texgs.core.memory import require_memory
from texgs.edit.axis_views import axis_cameras, nearest_to_axes
from texgs.edit.back_projection import back_project, fill_unseen, seen_texels
from texgs.edit.exposures import Exposure, expose
from texgs.edit.target_views import render_views, require_texture
from texgs.edit.texel_solver import learn, solve
from texgs.fields.optimizer import Rate
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.texels import bare_colors, owners, recolored
from texgs.models.guidance import EditViews, Guidance, require_edited
from texgs.models.instruction import require_instruction

SIZE = 512  # pixels along the longer side of the views: what InstructPix2Pix was trained on
PIXEL = 112  # bytes of memory for a pixel of a view: what the guidance sees, returns, and texels follow
SURFEL = 28  # and for a surfel in a view at one opacity
Views = Literal["axes", "nearest", "all"]


@dataclass(frozen=True)
class Policy:
    """How texels follow edited views.

    Raises:
        ArgumentError: naming the value that is out of range.
    """

    opacities: tuple[float, ...] = (2.0, 1.0, 0.5)  # factors on the scene's opacity while texels are found
    sweeps: int = 3  # of the solver, where there are no iterations
    iterations: int = 0  # of Adam, over which opacities follow each other; 0: solve
    rate: float = 0.025  # of Adam at the start
    final: float = 0.1  # at the end, relative to that

    def __post_init__(self) -> None:
        if self.sweeps < 1:
            raise ArgumentError(f"sweeps: expected at least 1, got {self.sweeps}")
        if self.iterations < 0 or not (self.rate > 0 and self.final > 0):
            raise ArgumentError(
                "iterations, rate, final: expected 0 or more and above 0, got "
                f"{self.iterations}, {self.rate} and {self.final}"
            )
        if not self.opacities or not all(0 < factor < float("inf") for factor in self.opacities):
            raise ArgumentError(f"opacities: expected factors above 0, at least one, got {self.opacities}")


@dataclass(frozen=True)
class Recipe:
    """Which views are edited, and how texels follow."""

    views: Views
    """Six new ones along the axes, filled by the scene; six training views nearest to the axes; or all."""
    policy: Policy


RECIPES = {
    # One edit of six views; texels are the solution of a linear problem.
    "default": Recipe("axes", Policy()),
    # One edit of six training views; texels by 1,500 iterations while the opacity falls, as in the paper.
    "paper": Recipe("nearest", Policy(opacities=(2.0, 1.5, 1.0, 0.75, 0.5), iterations=1500, final=1.0)),
}


@dataclass(frozen=True, eq=False)
class Edited:
    """What an edit gives."""

    model: Surfels
    """With new texels and offsets of surfels; the rest is that of the model edited, bit for bit."""
    views: EditViews
    """As the guidance saw them."""
    images: Tensor
    """[V, H, W, 3] as the guidance edited them."""
    seen: float
    """Share of the texels that may change that edited views show at some opacity; others are made up."""


def edit_by_text(
    model: Surfels,
    cameras: Sequence[Camera],
    guidance: Guidance,
    instruction: str,
    recipe: str = "default",
    *,
    views: Views | None = None,
    light: Light = HEADLIGHT,
    lit: bool | None = None,
    surfels: Tensor | None = None,
    size: int = SIZE,
    seed: int = 0,
) -> Edited:
    """Restyle a model by an instruction (the paper's sections Text-Driven NPSE and Text prompt refinement).

    Args:
        model: textured, possibly edited before: the guidance sees it as it is.
        cameras: of the training views; new views are made from as far as the first of them.
        guidance: edits views.
        instruction: such as "as a stipple drawing".
        recipe: of `RECIPES`.
        views: which are edited, see `Recipe`; those of the recipe by default.
        light: that shines on the scene while it is edited.
        lit: whether the guidance sees light; as it wants, by default. See `update`.
        surfels: [N] bool, which may change; all by default.
        size: pixels along the longer side of the six views; all training views are edited as they are.
        seed: of all random numbers.
    """
    if recipe not in RECIPES:
        raise ArgumentError(f"recipe: expected one of {', '.join(RECIPES)}, got {recipe!r}")
    if not cameras:
        raise ArgumentError("cameras: expected those of the training views, got none")
    if size < 1:
        raise ArgumentError(f"size: expected at least 1 pixel, got {size}")
    require_texture(model)
    return update(
        model,
        chosen(views or RECIPES[recipe].views, cameras, model.parameters["means"], size),
        guidance,
        instruction,
        RECIPES[recipe].policy,
        light=light,
        lit=lit,
        surfels=surfels,
        seed=seed,
        title=f"text, {recipe}",
    )


def chosen(views: Views, cameras: Sequence[Camera], means: Tensor, size: int) -> list[Camera]:
    """The cameras of the views to edit, from those of the training views; see `edit_by_text`."""
    if views not in get_args(Views):
        raise ArgumentError(f"views: expected one of {', '.join(get_args(Views))}, got {views!r}")
    if views == "all":
        return list(cameras)
    if views == "nearest":
        return [camera.resized(size) for camera in nearest_to_axes(cameras, means).values()]
    return list(axis_cameras(cameras[0].resized(size), means).values())


def update(
    model: Surfels,
    cameras: Sequence[Camera],
    guidance: Guidance,
    instruction: str,
    policy: Policy = Policy(),
    *,
    light: Light = HEADLIGHT,
    lit: bool | None = None,
    surfels: Tensor | None = None,
    seed: int = 0,
    title: str = "edit",
) -> Edited:
    """Edit a model by editing views of it (the paper's section Text-Driven NPSE).

    Geometry, material, lighting and palette stay as they are: views of any angle agree, however the
    edits differ. The model may be the result of an edit: its views show that (text prompt refinement). The
    opacity factors of the policy are those of the search only; the model keeps its own.

    Args:
        model: textured.
        cameras: of the views to edit, of one size, on the model's device.
        guidance: edits them.
        instruction: to the guidance.
        policy: how texels follow.
        light: that shines on the scene while it is edited.
        lit: whether the guidance sees the scene with light, and texels make up for it, or bare colours,
            which light falls on afterwards; by default as the guidance wants it.
        surfels: [N] bool, which may change; all by default. Others keep their colours bit for bit.
        seed: of all random numbers; with the same one, machine and versions, results are the same.
        title: of progress bars.
    """
    require_texture(model)
    instruction = require_instruction(instruction)
    changing = _changing(model, surfels)
    shine = light if (guidance.lit if lit is None else lit) else None
    generator = torch.Generator().manual_seed(seed)
    size = cameras[0].width * cameras[0].height if cameras else 0
    needed = len(cameras) * (PIXEL * size + SURFEL * len(policy.opacities) * len(model))
    require_memory(needed, f"{len(cameras)} views that are edited", "edit fewer views, or smaller ones")
    colors = bare_colors(model)
    views = render_views(model, bare_colors(model), cameras, shine)
    edited = require_edited(guidance(views, instruction, generator), views, guidance.name)
    rows = expose(model, views, edited, shine, policy.opacities, changing)
    colors, weights = _follow(rows, model, policy, generator, title)
    share = _share(weights, model, changing)
    return Edited(recolored(model, colors, changing), views, edited, share)


def _follow(
    rows: list[list[Exposure]], model: Surfels, policy: Policy, generator: torch.Generator, title: str
) -> tuple[Tensor, Tensor]:
    """Bare colours [T, 3], made up where nothing is seen, and how much each texel is seen [T]."""
    exposures = [exposure for row in rows for exposure in row]
    sums = back_project(exposures, model)
    if policy.iterations:
        rate, start = Rate(policy.rate, policy.final), bare_colors(model).clamp(0, 1)
        steps = policy.iterations
        learned = learn(rows, model, start, rate=rate, steps=steps, generator=generator, title=title)
        return fill_unseen(replace(sums, colors=learned), model), sums.weights
    start = fill_unseen(sums, model)
    sweeps = policy.sweeps
    colors = solve(exposures, model, sums, start, sweeps=sweeps, generator=generator, title=title)
    return colors, sums.weights


def changing_texels(model: Surfels, surfels: Tensor) -> Tensor:
    """Which texels [T] belong to some surfels [N], in their places in the list."""
    place, surfel = owners(model.parameters)
    mine = torch.zeros(len(model.parameters["texels"]), dtype=torch.bool, device=place.device)
    mine[place] = surfels[surfel]
    return mine


def _changing(model: Surfels, surfels: Tensor | None) -> Tensor:
    """Which surfels may change [N], bool."""
    n = len(model)
    if surfels is None:
        return torch.ones(n, dtype=torch.bool, device=model.device)
    check.shape("surfels", surfels, "N", N=n)
    if surfels.dtype != torch.bool or not bool(surfels.any()):
        raise ArgumentError(
            f"surfels: expected at least one that may change as bool, got {int(surfels.sum())} "
            f"of {surfels.dtype}; choose a segment that is not empty"
        )
    return surfels.to(model.device)


def _share(weights: Tensor, model: Surfels, changing: Tensor) -> float:
    """Share of the texels that may change that are seen."""
    share = float(seen_texels(weights)[changing_texels(model, changing)].double().mean())
    if share == 0:
        raise ArgumentError(
            "views: expected some that show what is to change, got none; choose other views "
            "(edit.text.views), or edit something that is less faint"
        )
    return share
