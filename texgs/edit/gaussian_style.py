"""StyleSplat: the colours of 3D Gaussians follow a style; where they are stays (Jain et al. 2024)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import torch

from texgs.core.camera import Camera
from texgs.edit.objective import Objective
from texgs.edit.recipe import Recipe
from texgs.edit.style_loop import Painting, learn_style
from texgs.edit.style_picture import StylePicture
from texgs.fields.gaussians.model import Gaussians
from texgs.fields.splats import join, split
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
    run = GaussianSteps(model, cameras, style, recipe, vgg)
    losses = learn_style(run, len(cameras), recipe, title)
    harmonics = {name: x.detach() for name, x in run.harmonics.items()}
    return replace(model, parameters=join({**run.geometry, **harmonics})), losses


class GaussianSteps:
    """Gaussians whose harmonics are on their way to a style."""

    def __init__(
        self,
        model: Gaussians,
        cameras: Sequence[Camera],
        style: StylePicture,
        recipe: Recipe,
        vgg: Vgg | None,
    ) -> None:
        self.model, self.cameras = model, cameras
        size = cameras[0].width, cameras[0].height
        self.objective = Objective.of_views(recipe, style.to(model.device), size, vgg)
        self.geometry = model.tensors("geometry")
        self.harmonics = {
            name: x.clone(memory_format=torch.contiguous_format).requires_grad_()
            for name, x in split(model.parameters["sh"]).items()
        }
        rates = {"sh": recipe.rate, "sh_rest": HIGHER * recipe.rate}
        groups = [{"params": [x], "lr": rates[name]} for name, x in self.harmonics.items()]
        self.adam = torch.optim.Adam(groups, eps=1e-15, fused=True)

    def render(self, view: int) -> list[Painting]:
        """Show a view over white."""
        learned = replace(self.model, parameters=join({**self.geometry, **self.harmonics}))
        shown = learned.render(self.cameras[view].to(self.model.device))
        image = shown.color.detach().permute(2, 0, 1).clamp(0, 1).requires_grad_()
        return [
            Painting(
                *(image, shown.alpha.detach(), self.objective),
                lambda gradient: shown.color.backward(gradient.permute(1, 2, 0)),
            )
        ]

    def step(self, iteration: int) -> None:
        """Take a step of Adam."""
        self.adam.step()
        self.adam.zero_grad()
