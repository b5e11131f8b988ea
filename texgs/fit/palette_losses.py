"""Losses of the parts of a palette field's fit, differentiable in the networks that learn in them."""

from __future__ import annotations

import torch
from torch import Tensor

from texgs.fields.palette.networks import (
    Parameters,
    base_color,
    density,
    light,
    palette_color,
)
from texgs.fields.palette.rendering import (
    Geometry,
    Shown,
    blending_weights,
    points_on,
    shown,
    view_harmonics,
)
from texgs.fit.kinds.palette import PaletteKeys

SEEDS = 16_384  # voxels that a step of the start looks at


def grid_loss(
    voxels: Tensor, geometry: Geometry, parameters: Parameters, generator: torch.Generator
) -> Tensor:
    """Mean squared difference [] of logarithms of density and of the grid's, at random voxels of [n, 3]."""
    drawn = torch.randint(len(voxels), (SEEDS,), generator=generator)
    sigma, _ = density(voxels[drawn], parameters, geometry.levels)
    return (sigma.log() - geometry.grid.density[1:][drawn].log()).square().mean()


def base_loss(
    rays: Tensor, target: Tensor, geometry: Geometry, parameters: Parameters, weight_min: float
) -> Tensor:
    """Mean squared error [] of rays [N, 6] with density and base colour over white.

    All points are looked at, and those with a weight above `weight_min` learn.
    """
    with torch.no_grad():
        points = points_on(rays, geometry, parameters)
        chosen = shown(points, weight_min).chosen.nonzero()[:, 0]
    sigma, features = density(points.at[chosen], parameters, geometry.levels)
    depth = points.depth.index_copy(0, chosen, geometry.length * sigma)
    weights = blending_weights(depth, points.ray)[chosen]
    shows = Shown(points.take(chosen), weights, chosen)
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
    """The loss [] of rays [N, 6] with palette colours and light, and the mean squared error in it.

    Offsets of colours are held down, and the palette stays near its start [P, 3].
    """
    with torch.no_grad():
        shows = shown(points_on(rays, geometry, parameters), settings.weight_min)
    mixed = palette_color(shows.points.at, parameters, geometry.levels)
    lit = light(shows.points.features, view_harmonics(rays)[shows.points.ray], parameters)
    error = error_over_white(shows, mixed.color + lit, target)
    offsets = shows.blend(mixed.offsets.flatten(1), len(rays)).square().mean()
    moved = (parameters["palette.colors"] - start).square().mean()
    return error + settings.offset_weight * offsets + settings.palette_weight * moved, error


def error_over_white(shows: Shown, colors: Tensor, target: Tensor) -> Tensor:
    """Mean squared difference [] of blended colours of points and those of their rays, [N, 3] over white."""
    values = torch.cat([colors, torch.ones_like(colors[:, :1])], dim=1)
    color, alpha = shows.blend(values, len(target)).split([3, 1], dim=1)
    return (color + 1 - alpha - target).square().mean()
