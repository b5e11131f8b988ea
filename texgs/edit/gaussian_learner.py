"""3D Gaussians that learn from whole views: what Instruct-GS2GS and DGE do between edits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.edit.closeness import Closeness, differentiated
from texgs.fields.gaussians.model import Gaussians
from texgs.fields.optimizer import Optimizer
from texgs.fields.splats import GEOMETRY, join, split
from texgs.fit.rates import extent, rates
from texgs.fit.settings import CommonRates, Rates
from texgs.volume.images import Images

PRUNE_EVERY = 100  # iterations
LEAST_OPACITY, LARGEST_SCALE, LARGEST_RADIUS = 0.005, 0.1, 5.0  # scale in extents; radius in pixels
SIGMAS = 3.0  # of a Gaussian that its radius on screen has


class GaussianLearner:
    """Gaussians with Adam.

    Args:
        model: to start from; it stays as it is.
        images: its training views.
        learning: rates of Adam.
        closeness: loss on views.
        iterations: in all.
        is_frozen: only harmonics learn.
        prunes: whether Gaussians that are faint, or large in the scene or on screen, are removed now and
            then, as DGE does.
    """

    def __init__(
        self,
        model: Gaussians,
        images: Images,
        learning: CommonRates,
        closeness: Closeness,
        iterations: int,
        *,
        is_frozen: bool = False,
        prunes: bool = False,
    ) -> None:
        self.original, self.closeness, self.iterations = model, closeness, iterations
        self.prunes = prunes and not is_frozen
        self.extent = extent(images.cameras, model.parameters["means"].cpu())
        raw = {**model.parameters, **split(model.parameters["sh"])}
        chosen = rates(raw, Rates(**asdict(learning)), self.extent)
        learned = {name: rate for name, rate in chosen.items() if not (is_frozen and name in GEOMETRY)}
        self.optimizer = Optimizer({name: x.contiguous() for name, x in raw.items()}, learned)
        self.iteration = 0
        self.radii = torch.zeros(len(model), device=model.device)  # largest on screen since the last pruning

    @property
    def field(self) -> Gaussians:
        """As they are now."""
        parameters = {name: x.detach() for name, x in self.optimizer.parameters.items()}
        return replace(self.original, parameters=join(parameters))

    def step(self, images: Images, views: Sequence[int], generator: torch.Generator) -> float:
        """Learn from one of these views, drawn at random; the loss."""
        view = views[int(torch.randint(len(views), (), generator=generator))]
        target = images.target(view, self.original.device)
        shown = replace(self.original, parameters=join(self.optimizer.parameters)).render(target.camera)
        loss, gradient = differentiated(self.closeness, shown.color, target.color)
        shown.color.backward(gradient)
        self.iteration += 1
        self.optimizer.step(self.iteration / self.iterations)
        if self.prunes:
            p = self.optimizer.parameters
            self.radii = self.radii.maximum(radii(p["means"].detach(), p["scales"].detach(), target.camera))
            if self.iteration % PRUNE_EVERY == 0:
                self._prune()
        return loss

    def _prune(self) -> None:
        p = {name: x.detach() for name, x in self.optimizer.parameters.items()}
        keep = (
            (p["opacities"].sigmoid() >= LEAST_OPACITY)
            & (p["scales"].exp().amax(dim=1) <= LARGEST_SCALE * self.extent)
            & (self.radii <= LARGEST_RADIUS)
        )
        if bool(keep.any()):
            self.optimizer.edit_rows(len(keep), keep, {name: x[:0] for name, x in p.items()})
        self.radii = torch.zeros(len(self.optimizer.parameters["means"]), device=keep.device)


def radii(means: Tensor, scales: Tensor, camera: Camera) -> Tensor:
    """Radii [N] in pixels of `SIGMAS` of the largest scale of Gaussians; 0 for those behind the camera.

    Args:
        means: [N, 3].
        scales: [N, 3], natural logarithm.
        camera: of the view.
    """
    _, z = camera.project(means)
    sides = SIGMAS * scales.exp().amax(dim=1) * camera.K[1, 1]
    return torch.where(z > 0, sides / z.clamp_min(1e-6), 0.0)
