"""The fit of a palette field to views: occupied space, density and base colour, then palette and light.

After StyleRF-VolVis (Tang et al. 2024), but for places and the start of densities, which are those of a short
fit of a voxel grid, and for rays near the object over white in place of all rays over random backgrounds.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace

import torch
from torch import Tensor

from texgs.fields.optimizer import Optimizer, Rate
from texgs.fields.palette.model import PaletteField
from texgs.fields.palette.networks import Parameters, base_color, density, light, new_networks, palette_color
from texgs.fields.palette.rendering import (
    Geometry,
    VisiblePoints,
    blending_weights,
    points_on,
    view_harmonics,
    visible_points,
)
from texgs.fitting.checkpoint import FOLDER, ResumableFit, run_to_end
from texgs.fitting.colors import object_palette
from texgs.fitting.ray_settings import PaletteKeys
from texgs.fitting.task import FitTask, Fitted
from texgs.fitting.voxels import VoxelFit
from texgs.raster.hash_encoding import HashLevels
from texgs.raster.voxel_grid import interpolate_rows, pack_rows, voxel_grid
from texgs.volume.images import Images

NEIGHBOURS = 2  # consecutive rays in a step
BETAS = (0.9, 0.99)  # Adam's
MIXTURE_NETWORKS = ("palette", "mixture", "trunk", "light")  # networks to learn in the last period
TRUSTED_SHARE = 0.5  # share of the grid's densities that decides where rays may end
MIN_DENSITY = 0.1  # least density of the grid's voxels, so that rays sample them
SEED_VOXELS = 16_384  # voxels per step while the density learns from the grid


@dataclass(frozen=True)
class Period:
    """A range of steps in which some networks learn."""

    start: int  # index of a step
    end: int
    networks: tuple[str, ...]  # to learn
    last_rate: float  # Adam's rate at the end, relative to the start


class PaletteFit(ResumableFit):
    """Networks on training views with alpha, over white.

    With the same seed of the start and of rays, machine and versions results are equal.
    """

    def __init__(self, images: Images, settings: PaletteKeys, seed: int = 0) -> None:
        settings.check()
        super().__init__(settings.steps)
        self.settings = settings
        self.voxels = VoxelFit(images, settings.voxels, seed)
        self.rays = self.voxels.rays
        self.generator = torch.Generator().manual_seed(seed)
        self.levels = HashLevels(**asdict(settings.hash))
        self.colors = object_palette(images, settings.colors, seed)  # [P, 3] at the start
        self.parameters: dict[str, Tensor] = {}

    @property
    def own(self) -> int:
        """Number of finished steps of the networks."""
        return max(self.iteration - self.settings.voxels.steps, 0)

    @property
    def periods(self) -> list[Period]:
        """The periods of the fit of networks, in order."""
        s = self.settings
        base, palette = s.seed_steps, s.seed_steps + s.base_steps
        return [
            Period(0, base, ("density",), 1.0),
            Period(base, palette, ("density", "trunk", "base"), s.last_rate),
            Period(palette, palette + s.palette_steps, MIXTURE_NETWORKS, s.last_rate),
        ]

    def run(self) -> Iterator[int]:
        """Fit the grid and the networks, from the current state."""
        for done in self.voxels.run():
            self.iteration = done
            yield done
        self.geometry = places(self.voxels, self.levels, self.settings.step)
        self.seeds = self.geometry.unit(self.geometry.grid.points())
        for period in self.periods:
            if self.own == period.start:
                self.begin(period)
            while self.own < period.end:
                self.step(period)
                yield self.iteration

    def field(self, metadata: Mapping[str, str]) -> PaletteField:
        """Return the fitted field after `run`, without the base colour."""
        kept = {name: x.detach() for name, x in self.parameters.items() if not name.startswith("base.")}
        return PaletteField(self.geometry, kept, metadata)

    def begin(self, period: Period) -> None:
        """Make the networks of a period, and an optimiser for the learned ones."""
        known = {name.split(".")[0] for name in self.parameters if name != "palette.colors"}
        new = new_networks({*period.networks} - known, self.levels, len(self.colors), self.generator)
        parameters = {"palette.colors": self.colors, **self.parameters, **new}
        learned = [name for name in parameters if name.split(".")[0] in period.networks]
        rate = Rate(self.settings.rate, period.last_rate)
        self.optimizer = Optimizer(parameters, dict.fromkeys(learned, rate), BETAS)
        self.parameters = self.optimizer.parameters

    def step(self, period: Period) -> None:
        """Take a step of the optimiser."""
        loss, error = self.loss_of(period)
        loss.backward()
        self.optimizer.step((self.own - period.start) / (period.end - period.start))
        self.iteration += 1
        if self.is_checked:
            self.note(error.detach(), {"loss": loss.detach(), **self.parameters})

    def loss_of(self, period: Period) -> tuple[Tensor, Tensor]:
        """Return the loss of a period and its reported part, for random voxels or rays."""
        s, networks = self.settings, self.parameters
        if "trunk" not in period.networks:
            drawn = torch.randint(len(self.seeds), (SEED_VOXELS,), generator=self.generator)
            sigma, _ = density(self.seeds[drawn], networks, self.levels)
            loss = (sigma.log() - self.geometry.grid.density[1:][drawn].log()).square().mean()
            return loss, loss
        rays, target = self.rays.draw(s.rays, NEIGHBOURS, self.generator)
        if "base" in period.networks:
            loss = base_loss(rays, target, self.geometry, networks, s.weight_min)
            return loss, loss
        return palette_loss(rays, target, self.geometry, networks, self.colors, s)

    def state(self) -> dict[str, Tensor]:
        """Return everything a resumed run needs, as tensors."""
        grid = {f"voxels.{name}": x for name, x in self.voxels.state().items()}
        networks = {f"networks.{name}": x for name, x in self.optimizer.state().items()} if self.own else {}
        return {**grid, **networks, "random": self.generator.get_state(), **super().state()}

    def restore(self, state: Mapping[str, Tensor]) -> None:
        """Continue from a result of `state`."""
        super().restore(state)
        self.voxels.restore(_under("voxels.", state))
        for period in self.periods:
            if period.start < self.own:
                self.begin(period)
        if self.own:
            self.optimizer.restore(_under("networks.", state))
        self.generator.set_state(state["random"])


def fit_palette(task: FitTask[PaletteKeys]) -> Fitted:
    """Fit networks to random rays, from the last checkpoint if any."""
    run = PaletteFit(task.images, task.settings, task.seed)
    seconds = run_to_end(run, task.output / FOLDER, task.title)
    field = run.field(task.metadata)
    return Fitted(field, seconds, run.iterations, run.losses, {"palette": field.colors.tolist()})


def places(fit: VoxelFit, levels: HashLevels, step: float) -> Geometry:
    """Return the voxels visible in the training views; networks are evaluated only in cells next to them."""
    grid = fit.grid
    around = voxel_grid(fit.seen(), grid.lower, grid.spacing, 0)
    values = (TRUSTED_SHARE * interpolate_rows(grid, around.points())[:, 3]).clamp_min(MIN_DENSITY)
    rows = torch.cat([around.rows[:1], pack_rows(values, torch.zeros(len(values), 1, 3))])
    return Geometry(around.with_rows(rows), replace(fit.march, step=step), levels)


def _under(prefix: str, state: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """Return the values whose names start with a prefix, and strip it."""
    return {name.removeprefix(prefix): x for name, x in state.items() if name.startswith(prefix)}


def base_loss(
    rays: Tensor, target: Tensor, geometry: Geometry, parameters: Parameters, weight_min: float
) -> Tensor:
    """Compute the mean squared error [] of rays [N, 6] with density and base colour over white.

    All points count, and those with a weight above `weight_min` learn.
    """
    with torch.no_grad():
        points = points_on(rays, geometry, parameters)
        chosen = visible_points(points, weight_min).chosen.nonzero()[:, 0]
    sigma, features = density(points.at[chosen], parameters, geometry.levels)
    depth = points.depth.index_copy(0, chosen, geometry.length * sigma)
    weights = blending_weights(depth, points.ray)[chosen]
    shows = VisiblePoints(points.take(chosen), weights, chosen)
    color = base_color(features, view_harmonics(rays)[shows.points.ray], parameters)
    return error_over_white(shows, color, target)


def palette_loss(
    rays: Tensor,
    target: Tensor,
    geometry: Geometry,
    parameters: Parameters,
    start: Tensor,
    settings: PaletteKeys,
) -> tuple[Tensor, Tensor]:
    """Compute the loss [] of rays [N, 6] with palette colours and light, and its mean squared error.

    The loss penalises offsets of colours, and distance of the palette from its start [P, 3].
    """
    with torch.no_grad():
        shows = visible_points(points_on(rays, geometry, parameters), settings.weight_min)
    mixed = palette_color(shows.points.at, parameters, geometry.levels)
    lit = light(shows.points.features, view_harmonics(rays)[shows.points.ray], parameters)
    error = error_over_white(shows, mixed.color + lit, target)
    offsets = shows.blend(mixed.offsets.flatten(1), len(rays)).square().mean()
    moved = (parameters["palette.colors"] - start).square().mean()
    return error + settings.offset_weight * offsets + settings.palette_weight * moved, error


def error_over_white(shows: VisiblePoints, colors: Tensor, target: Tensor) -> Tensor:
    """Return the mean squared error [] of blended points against the colours [N, 3] of rays over white."""
    values = torch.cat([colors, torch.ones_like(colors[:, :1])], dim=1)
    color, alpha = shows.blend(values, len(target)).split([3, 1], dim=1)
    return (color + 1 - alpha - target).square().mean()
