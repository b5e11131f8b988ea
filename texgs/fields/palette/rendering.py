"""Rays through fields of networks: points with density, the visible ones, and their blended colours."""

from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn.functional import normalize

from texgs.fields.palette.networks import Parameters, density
from texgs.raster.hash_encoding import HashLevels
from texgs.raster.reference.shading import harmonics
from texgs.raster.voxel_grid import VoxelGrid
from texgs.raster.voxels import March, ray_points

RAYS = 8192  # rays at a time


@dataclass(frozen=True, eq=False)
class Geometry:
    """The geometry of a field: its density network, evaluated where a coarse grid has density.

    The grid's own densities only decide where a ray may end.
    """

    grid: VoxelGrid  # of degree 0
    march: March
    levels: HashLevels

    @property
    def length(self) -> float:
        """The distance between points on a ray, world units."""
        return self.march.step * self.grid.spacing

    def unit(self, points: Tensor) -> Tensor:
        """Map world points [n, 3] to the unit cube around the grid's box."""
        side = self.grid.spacing * (max(self.grid.size) - 1)
        return (points - points.new_tensor(self.grid.lower)) / side


class DensePoints(NamedTuple):
    """Points on rays, ray by ray and front to back."""

    at: Tensor  # [n, 3] in the unit cube
    ray: Tensor  # [n]
    distance: Tensor  # [n] from the origin, in lengths of the ray's direction
    depth: Tensor  # [n] optical: density times length
    features: Tensor  # [n, 15] of the density network

    def take(self, chosen: Tensor) -> "DensePoints":
        """Select some points."""
        return DensePoints(*(x[chosen] for x in self))


class VisiblePoints(NamedTuple):
    """The points with enough weight in their rays."""

    points: DensePoints  # n of them
    weights: Tensor  # [n] blending weights
    chosen: Tensor  # bool, mask of all points

    def blend(self, values: Tensor, n_rays: int) -> Tensor:
        """Return weighted sums [N, C] of values [n, C] for each ray."""
        weighted = self.weights[:, None] * values
        return values.new_zeros(n_rays, values.shape[1]).index_add_(0, self.points.ray, weighted)


def points_on(rays: Tensor, geometry: Geometry, parameters: Parameters) -> DensePoints:
    """Return all points on rays [N, 6] inside the grid's dense cells, with their densities."""
    points, ray = ray_points(geometry.grid, rays, geometry.march)
    origin, direction = rays[ray].split(3, dim=1)
    distance = ((points - origin) * direction).sum(1) / direction.square().sum(1)
    at = geometry.unit(points)
    sigma, features = density(at, parameters, geometry.levels)
    return DensePoints(at, ray, distance, geometry.length * sigma, features)


def blending_weights(depth: Tensor, ray: Tensor) -> Tensor:
    """Return weights [n] of points with optical depths [n], in the order of their rays and front to back.

    The weight is the light that all points before let through, times the share that this one stops. Sums are
    of float64: they run over all rays.
    """
    total = depth.double().cumsum(0)
    before = total - depth
    place = torch.arange(len(ray))
    is_first = torch.ones_like(ray, dtype=torch.bool)
    is_first[1:] = ray[1:] != ray[:-1]
    first = torch.where(is_first, place, 0).cummax(0).values if len(ray) else place
    passed = before - before.index_select(0, first)
    return (torch.exp(-passed) * -torch.expm1(-depth)).float()


def visible_points(points: DensePoints, weight_min: float) -> VisiblePoints:
    """Choose the points with a weight above `weight_min`."""
    weights = blending_weights(points.depth, points.ray)
    chosen = weights > weight_min
    return VisiblePoints(points.take(chosen), weights[chosen], chosen)


def view_harmonics(rays: Tensor) -> Tensor:
    """Return spherical harmonics [N, 16] of the directions of rays [N, 6]."""
    return harmonics(normalize(rays[:, 3:], dim=1))


def merge_points(several: list[DensePoints]) -> tuple[DensePoints, Tensor]:
    """Merge the points of several fields in the order of rays; return also the field [n] of each.

    Densities of fields add up: a ray meets the points of all of them, each with its own depth.
    """
    points = DensePoints(*map(torch.cat, zip(*several, strict=True)))
    field = torch.repeat_interleave(torch.arange(len(several)), torch.tensor([len(p.ray) for p in several]))
    order = points.distance.argsort(stable=True)
    order = order[points.ray[order].argsort(stable=True)]
    return points.take(order), field[order]
