"""Image-driven editing: the texels of a basic model take on the style of a picture; nothing else changes."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from texgs.core import check
from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.core.light import Light
from texgs.core.progress import progress
from texgs.edit.objective import FeatureTerm, view_order
from texgs.edit.recipe import DEFAULT, Recipe
from texgs.edit.style_picture import StylePicture
from texgs.edit.style_steps import Stopwatch, StyleSteps
from texgs.fields.surfels.model import Surfels
from texgs.models.vgg import Vgg


@dataclass(frozen=True, eq=False)
class History:
    """How an edit went."""

    losses: dict[str, list[float]]  # weighted terms by name, a value for each iteration
    seconds: dict[str, float]  # by part


@dataclass(frozen=True, eq=False)
class Stylized:
    """A model in a style, and how it came to be."""

    model: Surfels
    history: History
    recipe: Recipe  # adapted to the scene


def stylize(
    model: Surfels,
    cameras: Sequence[Camera],
    lights: Sequence[Light],
    style: StylePicture,
    recipe: Recipe = DEFAULT,
    *,
    vgg: Vgg | None = None,
    clip: FeatureTerm | None = None,
    surfels: Tensor | None = None,
    title: str = "style",
    show: Callable[[Callable[[], Surfels]], None] | None = None,
) -> Stylized:
    """Give a model the style of a picture (the paper's section Image-Driven NPSE).

    Only texels and the surfels' colours (offsets from the palette) change: palette + offset + texel is the
    stylised colour without light, in [0, 1], so that the palette, lights and opacities can be edited as
    before and highlights stay what they were. What no view shows keeps the colour of the start.

    Args:
        model: of stage texture.
        cameras: to learn from, such as those of the training views; of one size.
        lights: one for each camera.
        style: the picture.
        recipe: how.
        vgg: for NNFM; needed unless the recipe's `features` or `lambda_s` is 0.
        clip: a differentiable loss [] of an image [H, W, 3] in [0, 1], for a `lambda_s` below 1.
        surfels: [N] bool, the ones to change; by default all. Texels and colours of others stay, bit for bit.
        title: of the progress bar.
        show: is called after each iteration with a function that makes the model as it is then.

    Raises:
        ArgumentError, ShapeError: if the model has no texture, there is no view, or a term is missing.
        FitError: if the loss is no longer finite; nothing is returned then.
    """
    _check(model, cameras, lights, surfels)
    watch = Stopwatch(model.device)
    with watch.part("start"):
        steps = StyleSteps.prepare(model, cameras, style, recipe, vgg, clip, surfels)
    losses: dict[str, list[float]] = defaultdict(list)
    order = view_order(len(cameras), recipe)
    for iteration, index in enumerate(progress(order, title=title, unit="iteration")):
        camera = cameras[index].to(watch.device)
        terms = steps.step(camera, lights[index], iteration, watch)
        for name, value in terms.items():
            losses[name].append(value)
        if show is not None:
            show(steps.result)
    return Stylized(steps.result(), History(dict(losses), dict(watch.seconds)), steps.recipe)


def _check(
    model: Surfels, cameras: Sequence[Camera], lights: Sequence[Light], surfels: Tensor | None
) -> None:
    if model.stage != "texture":
        raise ArgumentError(f"model: expected stage texture, got {model.stage}; fit its texture first")
    if not cameras or len(lights) != len(cameras):
        raise ArgumentError(
            f"lights: expected one for each of some cameras, got {len(lights)} for {len(cameras)}"
        )
    if surfels is not None:
        check.shape("surfels", surfels, "N", N=len(model))
        if surfels.dtype != torch.bool or not bool(surfels.any()):
            raise ArgumentError("surfels: expected a bool mask that chooses some, got none chosen")
