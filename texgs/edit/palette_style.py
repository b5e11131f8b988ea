"""StyleRF-VolVis (Tang et al. 2024): stylize the free colours of a palette field; density stays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import cos, pi
from typing import NamedTuple

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.core.progress import progress
from texgs.edit.objective import Objective
from texgs.edit.recipe import Recipe
from texgs.edit.style_loop import Losses, Painting, Terms, image_variation, learn_style
from texgs.edit.style_picture import StylePicture
from texgs.fields.palette.model import PaletteField
from texgs.fields.palette.networks import free_color, light, new_networks, palette_color
from texgs.fields.palette.rendering import RAYS, VisiblePoints, points_on, view_harmonics, visible_points
from texgs.fitting.colors import cluster_colors
from texgs.fitting.rays import training_rays
from texgs.metrics.retrieval import LUMINANCE
from texgs.models.vgg import Vgg
from texgs.raster.voxels import camera_rays
from texgs.volume.images import Images

CLUSTERS = 4  # clusters of a style's colours; the largest is its dominant one
DRAWN_RAYS, RUN_LENGTH = 4096, 2  # rays per step of the distillation, in runs of neighbours
RATE, LAST_RATE = 1e-2, 7e-5  # of Adam in the distillation
BETAS = (0.9, 0.99)
MIN_WEIGHT = 1e-3  # smallest weight of points that learn


def stylize_palette(
    field: PaletteField,
    images: Images,
    styles: Sequence[StylePicture],
    recipe: Recipe,
    distillation: int,
    variation: float,
    vgg: Vgg | None = None,
    title: str = "style",
) -> tuple[PaletteField, Losses, float]:
    """Stylize each palette colour of a field by a picture; density and light stay.

    Palette colours become the dominant ones of their styles, and free colours learn these in the steps of
    `distillation`. Then they follow the distance to the styles: of what has most of a palette colour, alone
    over the grey of its style; and total variation with its weight.

    Returns:
        The field, the losses, and the RMS difference of free and palette colours in the last step before; 0
        without steps.
    """
    if len(styles) != len(field.colors):
        raise ArgumentError(
            f"styles: expected one for each of {len(field.colors)} palette colours, got {len(styles)}"
        )
    dominant = [cluster_colors(style.pixels, CLUSTERS, recipe.seed)[0] for style in styles]
    field = replace(field, parameters={**field.parameters, "palette.colors": torch.stack(dominant)})
    objectives = [Objective.of_views(recipe, style, images.size, vgg) for style in styles]
    greys = [float(style.mean @ torch.tensor(LUMINANCE)) for style in styles]
    generator = torch.Generator().manual_seed(recipe.seed)
    run = PalettePainting(field, images.cameras, objectives, greys, variation, recipe.rate, generator)
    error = run.distil(images, distillation, title)
    losses = learn_style(run, len(images), recipe, title)
    return run.field, losses, error


class Layer(NamedTuple):
    """The part of rays that belongs to one palette colour, as far as free colours do not change it."""

    shows: VisiblePoints
    light: Tensor  # [n, 1]
    n_rays: int

    def values(self, color: Tensor) -> Tensor:
        """Return colours and alpha [N, 4] of rays, from free colours [n, 3]."""
        return self.shows.blend(
            torch.cat([color + self.light, torch.ones_like(self.light)], dim=1), self.n_rays
        )


class PalettePainting:
    """A recoloured field whose free colours learn styles.

    They begin with the features of the palette's hash grid; networks and rays are drawn at random. By palette
    colour they follow an objective, over a grey.
    """

    def __init__(
        self,
        field: PaletteField,
        cameras: Sequence[Camera],
        objectives: Sequence[Objective],
        greys: Sequence[float],
        variation: float,
        rate: float,
        generator: torch.Generator,
    ) -> None:
        self.levels, self.generator = field.geometry.levels, generator
        self.cameras, self.objectives, self.greys = cameras, objectives, greys
        free = new_networks(["free"], self.levels, len(field.colors), generator)
        free["free.table"] = field.parameters["palette.table"].clone()
        self.free = {name: x.requires_grad_() for name, x in free.items()}
        self.recolored = field
        self.variation, self.optimizer = variation, self.adam(rate)

    @property
    def field(self) -> PaletteField:
        """Return the field with its current free colours."""
        free = {name: x.detach() for name, x in self.free.items()}
        return replace(self.recolored, parameters={**self.recolored.parameters, **free})

    def distil(self, images: Images, steps: int, title: str) -> float:
        """Learn the colours of the recoloured palette at points of training rays; return the RMS error."""
        rays, adam, loss = training_rays(images), self.adam(RATE), torch.zeros(())
        for step in progress(range(steps), title=f"{title}, recoloured", unit="step"):
            drawn, _ = rays.draw(DRAWN_RAYS, RUN_LENGTH, self.generator)
            with torch.no_grad():
                points = points_on(drawn, self.recolored.geometry, self.recolored.parameters)
                at = visible_points(points, MIN_WEIGHT).points.at
                wanted = palette_color(at, self.recolored.parameters, self.levels).color
            loss = (free_color(at, self.free, self.levels) - wanted).square().mean()
            loss.backward()
            share = 0.5 * (1 + cos(pi * step / steps))
            adam.param_groups[0]["lr"] = LAST_RATE + (RATE - LAST_RATE) * share
            adam.step()
            adam.zero_grad()
        return loss.sqrt().item()

    def render(self, view: int) -> list[Painting]:
        """Render the part of a view that belongs to each palette colour."""
        camera = self.cameras[view]
        styles = zip(self.layers(camera), self.objectives, self.greys, strict=True)
        return [self.painting(camera, *each) for each in styles]

    def painting(self, camera: Camera, layer: Sequence[Layer], objective: Objective, grey: float) -> Painting:
        """Render the part of a view that belongs to one palette colour.

        The image is rendered without a graph, and each piece of it once more with one (deferred
        back-propagation, Zhang et al. 2022). Where a colour is cut off, it learns in the way back only.
        """
        with torch.no_grad():
            blended = torch.cat([part.values(self.colors(part)) for part in layer])  # [N, 4]
        planes = blended.T.unflatten(1, (camera.height, camera.width))
        color, alpha = planes[:3], planes[3]
        raw = color + grey * (1 - alpha)
        image = raw.clamp(0, 1).requires_grad_()

        def backward(gradient: Tensor) -> None:
            pulled = torch.where((raw - image) * gradient < 0, 0, gradient).flatten(1).T  # [N, 3]
            for part, given in zip(layer, pulled.split(RAYS), strict=True):
                part.values(self.colors(part))[:, :3].backward(given)

        def added(image: Tensor) -> Terms:
            return {"variation": self.variation * image_variation(image)}

        return Painting(image, alpha, objective, backward, added)

    def step(self, iteration: int) -> None:
        """Take a step of Adam."""
        self.optimizer.step()
        self.optimizer.zero_grad()

    def colors(self, layer: Layer) -> Tensor:
        """Return the free colours [n, 3] of the points of a layer."""
        return free_color(layer.shows.points.at, self.free, self.levels)

    @torch.no_grad()
    def layers(self, camera: Camera) -> list[list[Layer]]:
        """Return a layer for each palette colour of a view, in pieces of rays."""
        geometry, parameters = self.recolored.geometry, self.recolored.parameters
        colors = len(self.recolored.colors)
        pieces: list[list[Layer]] = [[] for _ in range(colors)]
        for rays in camera_rays(camera).flatten(0, 1).split(RAYS):
            points, harmonics = points_on(rays, geometry, parameters), view_harmonics(rays)
            shares = palette_color(points.at, parameters, self.levels).shares if colors > 1 else None
            for index, piece in enumerate(pieces):
                own = points if shares is None else points.take(shares.argmax(1) == index)
                shows = visible_points(own, MIN_WEIGHT)
                lit = light(shows.points.features, harmonics[shows.points.ray], parameters)
                piece.append(Layer(shows, lit, len(rays)))
        return pieces

    def adam(self, rate: float) -> torch.optim.Adam:
        """Return a new optimiser of the free colours."""
        return torch.optim.Adam([*self.free.values()], rate, BETAS, eps=1e-15, fused=True)
