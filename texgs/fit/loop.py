"""The training loop: one view per iteration, the same for every phase and recipe."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import torch
from torch import Tensor

from texgs.core import check
from texgs.core.errors import ArgumentError, FitError
from texgs.fields.bounds import visible_part
from texgs.fields.harmonics import join
from texgs.fields.optimizer import Optimizer
from texgs.fit.densify import DensityControl
from texgs.fit.losses import Shading, render_view, view_loss
from texgs.fit.rates import extent, rates
from texgs.fit.settings import Phase
from texgs.volume.images import Images

CHECKED_EVERY = 100  # iterations between looks at the loss and all parameters


@dataclass(frozen=True)
class Progress:
    """Where the loop is."""

    iteration: int  # done, from 1
    n_surfels: int
    loss: float | None  # where it was looked at


class Fit:
    """One phase of surfels or 3D Gaussians on one set of views.

    Args:
        parameters: raw, where the phase starts.
        shading: of the model.
        images: training views.
        phase: what to do.
        seed: of the order of views and of splits; with the same one, machine and versions results are equal.
    """

    unit = "view"

    def __init__(
        self,
        parameters: Mapping[str, Tensor],
        shading: Shading,
        images: Images,
        phase: Phase,
        seed: int,
    ) -> None:
        self.shading, self.images, self.phase, self.seed = shading, images, phase, seed
        self.iteration = 0
        self.seconds = 0.0  # that earlier runs have taken, kept by whoever times them
        self.losses: list[float] = []  # that were looked at, every CHECKED_EVERY iterations and at the end
        size = extent(images.cameras, parameters["means"])
        self.optimizer = Optimizer(parameters, rates(parameters, phase.rates, size))
        means = self.parameters["means"]
        self.control = DensityControl(phase.densify, len(means), size, means.device)

    @property
    def iterations(self) -> int:
        """Of the whole phase."""
        return self.phase.iterations

    @property
    def parameters(self) -> dict[str, Tensor]:
        """Raw parameters of now."""
        return self.optimizer.parameters

    def run(self) -> Iterator[Progress]:
        """Iterate to the end of the phase.

        Raises:
            FitError: if the loss or a parameter is no longer finite.
        """
        while self.iteration < self.phase.iterations:
            loss = self.step()
            is_looked_at = self.iteration % CHECKED_EVERY == 0 or self.iteration == self.phase.iterations
            if is_looked_at:
                require_finite(self.iteration, {"loss": loss, **self.parameters})
            value = float(loss) if is_looked_at else None
            self.losses += [] if value is None else [value]
            yield Progress(self.iteration, len(self.parameters["means"]), value)

    def step(self) -> Tensor:
        """One view: loss, gradients, a step of Adam, density control."""
        self.iteration += 1
        p = self.parameters
        target = visible_part(self.images, self.view_of(self.iteration), p, self.shading.options)
        is_observed = self.iteration <= self.phase.densify.stop
        shift = torch.zeros_like(p["means"][:, :2]).requires_grad_() if is_observed else None
        degrees = min(self.phase.sh_degree, self.iteration // self.phase.sh_every)
        visible = join(p, degrees)
        loss = view_loss(
            visible,
            self.shading,
            target,
            self.phase.losses,
            shift,
            self.iteration,
            self.phase.turns_normals,
        )
        loss.backward()
        if shift is not None and shift.grad is not None:
            self.control.observe(shift.grad, *self.images.size)
        self.optimizer.step(self.iteration / self.phase.iterations)
        self.control.step(self.iteration, self.optimizer, self.generator(2 * self.iteration + 1))
        return loss.detach()

    @torch.no_grad()
    def psnr(self) -> float:
        """Return the PSNR in dB of the first training view as it is now."""
        target = self.images.target(0, self.parameters["means"].device)
        error = (render_view(join(self.parameters), self.shading, target).clamp(0, 1) - target.color).square()
        return -10 * math.log10(max(float(error.mean()), 1e-10))

    def view_of(self, iteration: int) -> int:
        """The view of an iteration: every epoch a new order, without memory of the ones before."""
        epoch, place = divmod(iteration - 1, len(self.images))
        order = torch.randperm(len(self.images), generator=self.generator(2 * epoch))
        return int(order[place])

    def generator(self, stream: int) -> torch.Generator:
        """Random numbers that depend on the seed and a number only, so that a resumed run draws the same."""
        return torch.Generator().manual_seed(hash((self.seed, stream)) & 0x7FFFFFFF)

    def state(self) -> dict[str, Tensor]:
        """Everything a resumed run needs, as tensors."""
        control = {"control.gradients": self.control.gradients, "control.counts": self.control.counts}
        clock = {"iteration": torch.tensor(self.iteration), "seconds": torch.tensor(self.seconds).double()}
        return {**self.optimizer.state(), **control, **clock, "losses": torch.tensor(self.losses).double()}

    def restore(self, state: Mapping[str, Tensor]) -> None:
        """Go on from what `state` returned."""
        self.optimizer.restore(state)
        device = self.parameters["means"].device
        self.control.gradients = state["control.gradients"].to(device, copy=True)
        self.control.counts = state["control.counts"].to(device, copy=True)
        self.iteration = int(state["iteration"])
        self.seconds = float(state["seconds"])
        self.losses = state["losses"].tolist()


def require_finite(iteration: int, tensors: Mapping[str, Tensor]) -> None:
    """Stop a fit that has gone wrong; its loss alone does not tell: surfels with NaN are skipped."""
    try:
        check.finite(**tensors)
    except ArgumentError as error:
        raise FitError(
            f"iteration {iteration}: {error}; start again with lower rates, the last checkpoint is kept"
        ) from error
