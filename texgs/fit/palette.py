"""The fit of a palette field to views: where anything is, density and base colour, then palette and light.

After StyleRF-VolVis (Tang et al. 2024), but for places and the start of densities, which are those of a short
fit of a voxel grid, and for rays near the object over white in place of all rays over random backgrounds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass

import torch
from torch import Tensor

from texgs.fields.optimizer import Optimizer, Rate
from texgs.fields.palette.model import PaletteField
from texgs.fields.palette.networks import new_networks
from texgs.fields.palette.rendering import Geometry
from texgs.fit.kinds.palette import PaletteKeys
from texgs.fit.loop import require_finite
from texgs.fit.palette_losses import base_loss, grid_loss, palette_loss
from texgs.fit.palette_start import object_palette, places
from texgs.fit.voxels import VoxelFit
from texgs.raster.hash_encoding import HashLevels
from texgs.volume.images import Images

CHECKED_EVERY = 100  # steps between looks at the loss
NEIGHBOURS = 2  # rays of a step that follow each other
BETAS = (0.9, 0.99)  # of Adam
MIXED = ("palette", "mixture", "trunk", "light")  # networks that learn in the last part


@dataclass(frozen=True)
class PaletteProgress:
    """Where a fit is."""

    step: int  # done, from 1
    loss: float | None  # of the step, where it was looked at: in the end the mean squared error of its rays


@dataclass(frozen=True)
class Part:
    """Steps in which some networks learn."""

    start: int  # among the steps of networks
    end: int
    networks: tuple[str, ...]  # that learn
    last_rate: float  # of Adam at its end, relative to that at its start
    loss: Callable[[Geometry], tuple[Tensor, Tensor]]  # what is made small, and what of it is reported


class PaletteFit:
    """Networks on one set of views.

    Args:
        images: training views with alpha, over white.
        settings: what to do.
        seed: of the start and of rays; with the same one, machine and versions results are equal.

    Raises:
        ArgumentError: if settings do not fit each other, or the views show nothing.
    """

    unit = "step"

    def __init__(self, images: Images, settings: PaletteKeys, seed: int = 0) -> None:
        settings.check()
        self.settings = settings
        self.voxels = VoxelFit(images, settings.voxels, seed)
        self.rays = self.voxels.rays
        self.generator = torch.Generator().manual_seed(seed)
        self.levels = HashLevels(**asdict(settings.hash))
        self.colors = object_palette(images, settings.colors, seed)  # [P, 3] at the start
        self.parameters: dict[str, Tensor] = {}
        self.iteration = 0  # steps that are done
        self.seconds = 0.0  # that earlier runs have taken, kept by whoever times them
        self.losses: list[float] = []  # that were looked at

    @property
    def iterations(self) -> int:
        """Steps of the grid and the networks."""
        return self.settings.steps

    @property
    def own(self) -> int:
        """Steps of the networks that are done."""
        return max(self.iteration - self.settings.voxels.steps, 0)

    @property
    def parts(self) -> list[Part]:
        """Of the fit of networks, one after the other."""
        s = self.settings
        base, palette = s.seed_steps, s.seed_steps + s.base_steps
        return [
            Part(0, base, ("density",), 1.0, self.grid_loss),
            Part(base, palette, ("density", "trunk", "base"), s.last_rate, self.base_loss),
            Part(palette, palette + s.palette_steps, MIXED, s.last_rate, self.palette_loss),
        ]

    def run(self) -> Iterator[PaletteProgress]:
        """The grid and the networks, or what is left of them."""
        for done in self.voxels.run():
            self.iteration = done.step
            yield PaletteProgress(done.step, done.loss)
        self.geometry = places(self.voxels, self.levels, self.settings.step)
        self.seeds = self.geometry.unit(self.geometry.grid.points())
        for part in self.parts:
            if self.own == part.start:
                self.begin(part)
            while self.own < part.end:
                yield self.step(part)

    def field(self, metadata: Mapping[str, str]) -> PaletteField:
        """What was fitted, when `run` is at its end; without the base colour."""
        kept = {name: x.detach() for name, x in self.parameters.items() if not name.startswith("base.")}
        return PaletteField(self.geometry, kept, metadata)

    def begin(self, part: Part) -> None:
        """Make the networks of a part, and an optimiser of those that learn in it."""
        known = {name.split(".")[0] for name in self.parameters if name != "palette.colors"}
        missing = set(part.networks) - known
        new = new_networks(missing, self.levels, len(self.colors), self.generator)
        parameters = {"palette.colors": self.colors, **self.parameters, **new}
        learned = [name for name in parameters if name.split(".")[0] in part.networks]
        rate = Rate(self.settings.rate, part.last_rate)
        self.optimizer = Optimizer(parameters, dict.fromkeys(learned, rate), BETAS)
        self.parameters = self.optimizer.parameters

    def step(self, part: Part) -> PaletteProgress:
        """A loss, and a step of the optimiser."""
        loss, error = part.loss(self.geometry)
        loss.backward()
        self.optimizer.step((self.own - part.start) / (part.end - part.start))
        self.iteration += 1
        if self.iteration % CHECKED_EVERY and self.iteration != self.iterations:
            return PaletteProgress(self.iteration, None)
        require_finite(self.iteration, {"loss": loss.detach(), **self.parameters})
        self.losses.append(error.item())
        return PaletteProgress(self.iteration, self.losses[-1])

    def grid_loss(self, geometry: Geometry) -> tuple[Tensor, Tensor]:
        """Of densities against those of the grid."""
        loss = grid_loss(self.seeds, geometry, self.parameters, self.generator)
        return loss, loss.detach()

    def base_loss(self, geometry: Geometry) -> tuple[Tensor, Tensor]:
        """Of random rays with base colours."""
        rays, target = self.rays.draw(self.settings.rays, NEIGHBOURS, self.generator)
        loss = base_loss(rays, target, geometry, self.parameters, self.settings.weight_min)
        return loss, loss.detach()

    def palette_loss(self, geometry: Geometry) -> tuple[Tensor, Tensor]:
        """Of random rays with palette colours."""
        rays, target = self.rays.draw(self.settings.rays, NEIGHBOURS, self.generator)
        loss, error = palette_loss(rays, target, geometry, self.parameters, self.colors, self.settings)
        return loss, error.detach()

    def psnr(self) -> None:
        """Return nothing: the losses of the parts are of other kinds than errors of images."""

    def state(self) -> dict[str, Tensor]:
        """Everything a resumed run needs, as tensors, between two steps."""
        grid = {f"voxels.{name}": x for name, x in self.voxels.state().items()}
        networks = {f"networks.{name}": x for name, x in self.optimizer.state().items()} if self.own else {}
        clock = {"iteration": torch.tensor(self.iteration), "seconds": torch.tensor(self.seconds).double()}
        told = {"losses": torch.tensor(self.losses).double(), "random": self.generator.get_state()}
        return {**grid, **networks, **clock, **told}

    def restore(self, state: Mapping[str, Tensor]) -> None:
        """Go on from what `state` returned, as if the run had never stopped."""
        self.voxels.restore(_under("voxels.", state))
        self.iteration = int(state["iteration"])
        for part in self.parts:
            if part.start < self.own:
                self.begin(part)
        if self.own:
            self.optimizer.restore(_under("networks.", state))
        self.seconds = float(state["seconds"])
        self.losses = state["losses"].tolist()
        self.generator.set_state(state["random"])


def _under(prefix: str, state: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """Values whose names have a prefix, without it."""
    return {name.removeprefix(prefix): x for name, x in state.items() if name.startswith(prefix)}
