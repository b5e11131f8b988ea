"""The training loop: one view per iteration, the same for every phase and recipe."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.errors import FitError
from texgs.core.progress import progress
from texgs.fields.optimizer import Optimizer, Rate
from texgs.fields.splats import Shading, Splats, join, visible_part
from texgs.fields.surfels.model import Surfels
from texgs.fitting.attributes import HELD_ATTRIBUTES, Attributes
from texgs.fitting.checkpoint import ResumableFit
from texgs.fitting.densify import DensityControl
from texgs.fitting.losses import view_loss
from texgs.fitting.settings import Phase, Rates
from texgs.raster.shading import MATERIAL
from texgs.volume.images import Images

USUAL_DISTANCE = 4.0  # of cameras, in radii of the object
MIN_EXTENT = 1e-3  # world units


class Fit(ResumableFit):
    """One phase of surfels or 3D Gaussians, from raw parameters, on training views.

    Surfels that are held learn how their colours and normals differ from those of their volume.

    With the same seed of the order of views and of splits, machine and versions results are equal.
    """

    unit = "view"

    def __init__(
        self,
        parameters: Mapping[str, Tensor],
        shading: Shading,
        images: Images,
        phase: Phase,
        seed: int,
        held: Attributes | None = None,
    ) -> None:
        super().__init__(phase.iterations)
        self.held = held
        if held is not None:
            parameters = held.differences(parameters)
        self.shading, self.images, self.phase, self.seed = shading, images, phase, seed
        self.order: tuple[int, list[int]] = (-1, [])  # an epoch and its views
        size = extent(images.cameras, parameters["means"])
        hold = 0.0 if held is None else held.hold
        self.optimizer = Optimizer(parameters, rates(parameters, phase.rates, size, hold))
        means = self.parameters["means"]
        self.control = DensityControl(phase.densify, len(means), size, means.device)

    @property
    def parameters(self) -> dict[str, Tensor]:
        """The current learned parameters."""
        return self.optimizer.parameters

    @property
    def fitted(self) -> dict[str, Tensor]:
        """Current raw parameters of the surfels or Gaussians; differentiable in `parameters`."""
        return self.parameters if self.held is None else self.held.added_to(self.parameters)

    @property
    def result(self) -> dict[str, Tensor]:
        """The fitted raw parameters, without a graph."""
        return {name: x.detach() for name, x in self.fitted.items()}

    def run(self) -> Iterator[int]:
        """Iterate to the end of the phase."""
        while self.iteration < self.iterations:
            loss = self.step()
            if self.is_checked:
                self.note(loss, {"loss": loss, **self.parameters})
            yield self.iteration

    def step(self) -> Tensor:
        """Learn from one view: loss, gradients, a step of Adam, density control."""
        self.iteration += 1
        p, phase = self.parameters, self.phase
        target = visible_part(self.images, self.view_of(self.iteration), p, self.shading.options)
        is_observed = self.iteration <= phase.densify.stop
        shifts = p["means"].new_empty(len(p["means"]), 2) if is_observed else None
        visible = join(self.fitted, min(phase.sh_degree, self.iteration // phase.sh_every))
        loss = view_loss(
            visible, self.shading, target, phase.losses, shifts, self.iteration, phase.turns_normals
        )
        loss.backward()
        self.optimizer.step(self.iteration / self.iterations)
        if shifts is not None:
            self.control.observe(shifts, *self.images.size)
            self.control.step(self.iteration, self.optimizer, self.generator(2 * self.iteration + 1))
        if not len(self.parameters["means"]):
            raise FitError(
                f"iteration {self.iteration}: expected something that shows in the views, but all of it has "
                "been pruned; let the transfer function show more, or lower densify.prune_opacity"
            )
        return loss.detach()

    @torch.no_grad()
    def psnr(self) -> float:
        """Return the current PSNR in dB of the first training view."""
        target = self.images.target(0, self.parameters["means"].device)
        now = Splats(join(self.fitted), self.shading).render(target.camera, target.light).color
        error = (now.clamp(0, 1) - target.color).square()
        return -10 * math.log10(max(float(error.mean()), 1e-10))

    def view_of(self, iteration: int) -> int:
        """Return the view of an iteration; each epoch has a new order that depends only on its number."""
        epoch, place = divmod(iteration - 1, len(self.images))
        if self.order[0] != epoch:
            order = torch.randperm(len(self.images), generator=self.generator(2 * epoch))
            self.order = epoch, order.tolist()
        return self.order[1][place]

    def generator(self, stream: int) -> torch.Generator:
        """Return a generator for the seed and a number only, so that resumed runs draw the same."""
        return torch.Generator().manual_seed(hash((self.seed, stream)) & 0x7FFFFFFF)

    def state(self) -> dict[str, Tensor]:
        """Return everything a resumed run needs, as tensors."""
        control = {"control.gradients": self.control.gradients, "control.counts": self.control.counts}
        return {**self.optimizer.state(), **control, **super().state()}

    def restore(self, state: Mapping[str, Tensor]) -> None:
        """Continue from a result of `state`."""
        super().restore(state)
        self.optimizer.restore(state)
        device = self.parameters["means"].device
        self.control.gradients = state["control.gradients"].to(device, copy=True)
        self.control.counts = state["control.counts"].to(device, copy=True)


def fit_further(
    model: Surfels, images: Images, phase: Phase, seed: int, title: str, held: Attributes | None = None
) -> Surfels:
    """Fit a phase starting from a model, without checkpoints; return the new model."""
    fit = Fit(model.parameters, model.shading, images, phase, seed, held)
    for _ in progress(fit.run(), phase.iterations, title=title, unit=fit.unit):
        pass
    return replace(model, parameters=fit.result)


def extent(cameras: Sequence[Camera], means: Tensor) -> float:
    """Return the unit of length for rates of means and sizes of density control.

    1.1 times the largest distance of a camera from the cameras' mean. One camera, or some inside of the
    object, have none to speak of: they count as far away as an object is usually seen from.
    """
    around = mean_distance(torch.stack([camera.position for camera in cameras]))
    radius = mean_distance(means)
    return 1.1 * max(around if around > radius else USUAL_DISTANCE * radius, MIN_EXTENT)


def mean_distance(points: Tensor) -> float:
    """Return the largest distance of points [N, 3] from their mean; 0 for none."""
    return float((points - points.mean(dim=0)).norm(dim=1).max()) if len(points) else 0.0


def rates(names: Iterable[str], r: Rates, size: float, hold: float = 0.0) -> dict[str, Rate]:
    """Return the rate of each learned parameter; `size` is the extent of the cameras."""
    starts = {"quats": r.quats, "scales": r.scales, "opacities": r.opacities, "colors": r.colors}
    starts |= {"normals": r.quats, "sh": r.sh, "sh_rest": r.sh_rest, **dict.fromkeys(MATERIAL, r.material)}
    chosen = {
        name: Rate(starts[name], r.final, hold if name in HELD_ATTRIBUTES else 0.0)
        for name in names
        if name in starts
    }
    chosen["means"] = Rate(size * r.means, r.means_final)
    return {name: rate for name, rate in chosen.items() if rate.start > 0}
