"""StyleSplat: the colours of 3D Gaussians follow a style; where they are stays (Jain et al. 2024)."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace

import torch

from texgs.core.camera import Camera
from texgs.core.progress import progress
from texgs.edit.objective import Objective, differentiated, finite_values, view_order
from texgs.edit.recipe import Recipe
from texgs.edit.style_picture import StylePicture
from texgs.fields.gaussians.model import Gaussians
from texgs.fields.harmonics import join, split
from texgs.models.vgg import Vgg

HIGHER = 1 / 20  # rate of the higher harmonics, against that of the zeroth


def stylize_gaussians(
    model: Gaussians,
    cameras: Sequence[Camera],
    style: StylePicture,
    recipe: Recipe,
    vgg: Vgg | None = None,
    title: str = "style",
) -> tuple[Gaussians, dict[str, list[float]]]:
    """Give Gaussians the style of a picture; only their spherical harmonics change.

    Args:
        model: fitted.
        cameras: of its training views, of one size, on any device.
        style: the picture.
        recipe: of the distance to the style; a view in each iteration.
        vgg: for NNFM, if the recipe wants it.
        title: of the progress bar.

    Returns:
        The Gaussians, and the weighted terms of the loss by name, a value for each iteration.
    """
    width, height = cameras[0].width, cameras[0].height
    scaled = style.to(model.device).scaled(recipe.pattern * max(width, height))
    objective = Objective.of(recipe, scaled, recipe.reduction(width, height), vgg, None)
    geometry, harmonics = model.tensors("geometry"), split(model.parameters["sh"])
    learned = {name: x.clone(memory_format=torch.contiguous_format) for name, x in harmonics.items()}
    rates = {"sh": recipe.rate, "sh_rest": HIGHER * recipe.rate}
    groups = [{"params": [x.requires_grad_()], "lr": rates[name]} for name, x in learned.items()]
    adam = torch.optim.Adam(groups, eps=1e-15, fused=True)
    losses: dict[str, list[float]] = defaultdict(list)
    order = view_order(len(cameras), recipe)
    for iteration, index in enumerate(progress(order, title=title, unit="iteration")):
        camera = cameras[index].to(model.device)
        shown = replace(model, parameters=join({**geometry, **learned})).render(camera)
        image = shown.color.detach().permute(2, 0, 1).clamp(0, 1).requires_grad_()
        terms = objective.terms(image, shown.alpha.detach(), iteration)
        for name, value in finite_values(terms, iteration).items():
            losses[name].append(value)
        shown.color.backward(differentiated(terms, image).permute(1, 2, 0))
        adam.step()
        adam.zero_grad()
    learned = {name: x.detach() for name, x in learned.items()}
    return replace(model, parameters=join({**geometry, **learned})), dict(losses)
