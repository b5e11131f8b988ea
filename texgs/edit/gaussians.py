"""Let 3D Gaussians follow a style (StyleSplat, Jain et al. 2024) or edited views (Instruct-GS2GS, DGE)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.edit.dataset_update import PhotometricLoss
from texgs.edit.objective import Objective
from texgs.edit.recipe import Recipe
from texgs.edit.style_loop import Losses, Painting, learn_style
from texgs.edit.style_picture import StylePicture
from texgs.fields.gaussians import Gaussians
from texgs.fields.optimizer import Optimizer
from texgs.fields.splats import GEOMETRY, join, split
from texgs.fitting.loop import extent, rates
from texgs.fitting.settings import CommonRates, Rates
from texgs.models.vgg import Vgg
from texgs.volume.images import Images

HIGHER_RATE = 1 / 20  # rate of the higher harmonics, relative to the zeroth, for styles
PRUNE_INTERVAL = 100  # iterations
MIN_OPACITY, MAX_SCALE, MAX_RADIUS = 0.005, 0.1, 5.0  # scale in extents; radius in pixels
SIGMAS = 3.0  # standard deviations of a Gaussian in its radius on screen


def stylize_gaussians(
    model: Gaussians,
    cameras: Sequence[Camera],
    style: StylePicture,
    recipe: Recipe,
    vgg: Vgg | None = None,
    title: str = "style",
) -> tuple[Gaussians, Losses]:
    """Stylize Gaussians on training views; only their spherical harmonics change."""
    size = cameras[0].width, cameras[0].height
    run = GaussianPainting(model, cameras, Objective.of_views(recipe, style.to(model.device), size, vgg))
    losses = learn_style(run, len(cameras), recipe, title)
    harmonics = {name: x.detach() for name, x in run.harmonics.items()}
    return replace(model, parameters=join({**run.geometry, **harmonics})), losses


class GaussianPainting:
    """Gaussians whose harmonics learn a style."""

    def __init__(self, model: Gaussians, cameras: Sequence[Camera], objective: Objective) -> None:
        self.model, self.cameras, self.objective = model, cameras, objective
        self.geometry = model.tensors("geometry")
        self.harmonics = {
            name: x.clone(memory_format=torch.contiguous_format).requires_grad_()
            for name, x in split(model.parameters["sh"]).items()
        }
        rate = objective.recipe.rate
        rates = {"sh": rate, "sh_rest": HIGHER_RATE * rate}
        groups = [{"params": [x], "lr": rates[name]} for name, x in self.harmonics.items()]
        self.adam = torch.optim.Adam(groups, eps=1e-15, fused=True)

    def render(self, view: int) -> list[Painting]:
        """Render a view over white."""
        learned = replace(self.model, parameters=join({**self.geometry, **self.harmonics}))
        shown = learned.render(self.cameras[view].to(self.model.device))
        image = shown.color.detach().permute(2, 0, 1).clamp(0, 1).requires_grad_()

        def backward(gradient: Tensor) -> None:
            shown.color.backward(gradient.permute(1, 2, 0))

        return [Painting(image, shown.alpha.detach(), self.objective, backward)]

    def step(self, iteration: int) -> None:
        """Take a step of Adam."""
        self.adam.step()
        self.adam.zero_grad()


class GaussianLearner:
    """Gaussians that learn from whole views by Adam; the given model stays unchanged.

    If frozen, only harmonics learn. Otherwise `prune` regularly removes Gaussians that are faint, or large in
    the scene or on screen.
    """

    def __init__(
        self,
        model: Gaussians,
        images: Images,
        loss: PhotometricLoss,
        iterations: int,
        common: CommonRates,
        frozen: bool,
        prune: bool = False,
    ) -> None:
        self.original, self.loss, self.iterations = model, loss, iterations
        self.prunes = prune and not frozen
        self.extent = extent(images.cameras, model.parameters["means"].cpu())
        raw = {**model.parameters, **split(model.parameters["sh"])}
        chosen = rates(raw, Rates(**asdict(common)), self.extent)
        learned = {name: rate for name, rate in chosen.items() if not (frozen and name in GEOMETRY)}
        self.optimizer = Optimizer({name: x.contiguous() for name, x in raw.items()}, learned)
        self.iteration = 0
        self.radii = torch.zeros(len(model), device=model.device)  # largest on screen since the last pruning

    @property
    def field(self) -> Gaussians:
        """Return the current Gaussians."""
        parameters = {name: x.detach() for name, x in self.optimizer.parameters.items()}
        return replace(self.original, parameters=join(parameters))

    def step(self, images: Images, views: Sequence[int], generator: torch.Generator) -> float:
        """Learn from one of these views, drawn at random; return the loss."""
        view = views[int(torch.randint(len(views), (), generator=generator))]
        target = images.target(view, self.original.device)
        shown = replace(self.original, parameters=join(self.optimizer.parameters)).render(target.camera)
        loss, gradient = self.loss.with_gradient(shown.color, target.color)
        shown.color.backward(gradient)
        self.iteration += 1
        self.optimizer.step(self.iteration / self.iterations)
        if self.prunes:
            p = self.optimizer.parameters
            self.radii = self.radii.maximum(radii(p["means"].detach(), p["scales"].detach(), target.camera))
            if self.iteration % PRUNE_INTERVAL == 0:
                self._prune()
        return loss

    def _prune(self) -> None:
        p = {name: x.detach() for name, x in self.optimizer.parameters.items()}
        keep = (
            (p["opacities"].sigmoid() >= MIN_OPACITY)
            & (p["scales"].exp().amax(dim=1) <= MAX_SCALE * self.extent)
            & (self.radii <= MAX_RADIUS)
        )
        if bool(keep.any()):
            self.optimizer.edit_rows(len(keep), keep, {name: x[:0] for name, x in p.items()})
        self.radii = torch.zeros(len(self.optimizer.parameters["means"]), device=keep.device)


def radii(means: Tensor, scales: Tensor, camera: Camera) -> Tensor:
    """Return the radii [N] of Gaussians on screen in pixels, from means and raw scales [N, 3]; 0 behind."""
    _, z = camera.project(means)
    sides = SIGMAS * scales.exp().amax(dim=1) * camera.K[1, 1]
    return torch.where(z > 0, sides / z.clamp_min(1e-6), 0.0)
