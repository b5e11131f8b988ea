"""Text-driven editing: the recipes and the views they edit."""

from __future__ import annotations

from collections.abc import Sequence

from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.core.light import HEADLIGHT, Light
from texgs.edit.axis_views import axis_cameras
from texgs.edit.target_update import Edited, Policy, update
from texgs.edit.target_views import require_texture
from texgs.fields.surfels.model import Surfels
from texgs.models.guidance import Guidance

SIZE = 512  # pixels along the longer side of the views: what InstructPix2Pix was trained on

RECIPES = {
    # One edit of six views; texels are the solution of a linear problem.
    "default": Policy(),
    # The same edit; texels by 1,500 iterations while the opacity falls, as the paper finds them.
    "paper": Policy(opacities=(2.0, 1.5, 1.0, 0.75, 0.5), iterations=1500),
    # All views given, again and again, as IN2N and InstructGS2GS do: what the paper compares with.
    "iterative": Policy(rounds=3, opacities=(1.0,), iterations=2500),
}


def edit_by_text(
    model: Surfels,
    cameras: Sequence[Camera],
    guidance: Guidance,
    instruction: str,
    recipe: str = "default",
    *,
    light: Light = HEADLIGHT,
    lit: bool | None = None,
    surfels: Tensor | None = None,
    size: int = SIZE,
    seed: int = 0,
) -> Edited:
    """Restyle a model by an instruction (the paper's sections Text-Driven NPSE and Text prompt refinement).

    Args:
        model: textured, possibly edited before: the guidance sees it as it is.
        cameras: of the training views. Recipes of one round edit six new views along the axes, from as far
            as the first of these and filled by the scene; the others edit these as they are.
        guidance: edits views.
        instruction: such as "as a stipple drawing".
        recipe: of `RECIPES`.
        light: that shines on the scene while it is edited.
        lit: whether the guidance sees light; as it wants, by default. See `update`.
        surfels: [N] bool, which may change; all by default.
        size: pixels along the longer side of the six views; they have the aspect of the first camera.
        seed: of all random numbers.

    Raises:
        ArgumentError: if there is no camera, the recipe is unknown, or an argument is not as `update` and
            `axis_cameras` expect it.
    """
    if recipe not in RECIPES:
        raise ArgumentError(f"recipe: expected one of {', '.join(RECIPES)}, got {recipe!r}")
    if not cameras:
        raise ArgumentError("cameras: expected those of the training views, got none")
    if size < 1:
        raise ArgumentError(f"size: expected at least 1 pixel, got {size}")
    require_texture(model)
    policy = RECIPES[recipe]
    if policy.rounds == 1:
        first = cameras[0]
        scale = size / max(first.width, first.height)
        pixels = [max(1, round(side * scale)) for side in (first.width, first.height)]
        cameras = list(axis_cameras(first, model.parameters["means"], *pixels).values())
    return update(
        model,
        cameras,
        guidance,
        instruction,
        policy,
        light=light,
        lit=lit,
        surfels=surfels,
        seed=seed,
        title=f"text, {recipe}",
    )
