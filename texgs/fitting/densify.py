"""Adaptive density control of surfels or 3D Gaussians: clone and split by gradients, prune by opacity."""

import torch
from torch import Tensor

from texgs.core.geometry import quats_to_matrices
from texgs.fields.optimizer import Optimizer
from texgs.fitting.settings import Densify
from texgs.raster import native
from texgs.raster.shading import MATERIAL

CHILDREN = 2  # surfels that replace a split one
SHRINK_FACTOR = 1.6  # factor by which children are smaller
RESET_OPACITY = 0.01
native.declare("texgs_observe", "n p ff pp")


def is_shared(name: str, values: Tensor) -> bool:
    """Return whether a parameter is a material shared by all surfels, even if there is only one."""
    return name in MATERIAL and len(values) == 1


class DensityControl:
    """Statistics of n surfels or Gaussians since the last step, and the steps of density control.

    As in Kerbl et al. 2023, section 5, and 2DGS; `extent` is the radius of the cameras, world units.
    """

    def __init__(self, settings: Densify, n: int, extent: float, device: torch.device) -> None:
        self.settings, self.extent = settings, extent
        self._clear(n, device)

    def _clear(self, n: int, device: torch.device) -> None:
        self.gradients = torch.zeros(n, device=device)  # sums of norms, half image widths
        self.counts = torch.zeros(n, device=device)  # views in which a surfel had a gradient

    def observe(self, shift_gradient: Tensor, width: int, height: int) -> None:
        """Record the gradient [N, 2] of the loss by shifts in pixels."""
        given = (len(shift_gradient), shift_gradient, 0.5 * width, 0.5 * height)
        native.call("texgs_observe", *given, self.gradients, self.counts, device=shift_gradient.device)

    def step(self, iteration: int, optimizer: Optimizer, generator: torch.Generator) -> None:
        """Densify, prune or reset opacities by the schedule, at an iteration counted from 1."""
        s = self.settings
        if iteration > s.stop:
            return
        if iteration > s.start and iteration % s.every == 0:
            self._densify(iteration, optimizer, generator)
        if iteration in s.resets:
            raw = optimizer.parameters["opacities"].detach()
            optimizer.reset("opacities", raw.clamp_max(torch.logit(torch.tensor(RESET_OPACITY)).item()))

    def _densify(self, iteration: int, optimizer: Optimizer, generator: torch.Generator) -> None:
        p = {name: x.detach() for name, x in optimizer.parameters.items()}
        n = len(p["means"])
        largest = p["scales"].exp().amax(dim=1)
        alive = p["opacities"].sigmoid() >= self.settings.prune_opacity
        if iteration > self.settings.prune_size_from:
            alive &= largest <= self.settings.prune_size * self.extent
        chosen = self._chosen(alive)
        is_split = chosen & (largest > self.settings.size * self.extent)
        rows = {name: x for name, x in p.items() if len(x) == n and not is_shared(name, x)}
        clones = {name: x[chosen & ~is_split] for name, x in rows.items()}
        children = self._children({name: x[is_split] for name, x in rows.items()}, generator)
        added = {name: torch.cat([clones[name], children[name]]) for name in rows}
        optimizer.edit_rows(n, alive & ~is_split, added)
        self._clear(len(optimizer.parameters["means"]), largest.device)

    def _chosen(self, alive: Tensor) -> Tensor:
        """Choose surfels [N] bool with the largest mean gradients above the threshold, up to the cap."""
        mean = self.gradients / self.counts.clamp_min(1)
        mean = torch.where(alive & (mean > self.settings.threshold), mean, 0.0)
        cap = self.settings.cap
        room = len(mean) if cap is None else max(0, cap - int(alive.sum()))
        chosen = torch.zeros_like(alive)
        best = mean.topk(min(room, len(mean))).indices
        chosen[best[mean[best] > 0]] = True
        return chosen

    def _children(self, parents: dict[str, Tensor], generator: torch.Generator) -> dict[str, Tensor]:
        """Replace each by two smaller ones, drawn from its Gaussian."""
        rows = {name: x.repeat(CHILDREN, *[1] * (x.ndim - 1)) for name, x in parents.items()}
        noise = torch.randn(rows["scales"].shape, generator=generator).to(rows["scales"])
        along = quats_to_matrices(rows["quats"])[..., : rows["scales"].shape[1]]  # [n, 3, 2 or 3]
        rows["means"] = rows["means"] + (along @ (noise * rows["scales"].exp())[..., None]).squeeze(-1)
        rows["scales"] = rows["scales"] - torch.log(torch.tensor(SHRINK_FACTOR)).item()
        return rows
