"""Text-driven editing: the recipes and the views they edit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.core.light import HEADLIGHT, Light
from texgs.edit.axis_views import axis_cameras, nearest_to_axes
from texgs.edit.target_update import Edited, Policy, update
from texgs.edit.target_views import require_texture
from texgs.fields.surfels.model import Surfels
from texgs.models.guidance import Guidance

SIZE = 512  # pixels along the longer side of the views: what InstructPix2Pix was trained on
Views = Literal["axes", "nearest", "all"]


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
    # All views given, again and again, as IN2N and InstructGS2GS do: what the paper compares with.
    "iterative": Recipe("all", Policy(rounds=3, opacities=(1.0,), iterations=2500)),
}


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
