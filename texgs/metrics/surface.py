"""Errors of a mesh against a known surface: Chamfer distance, F-score and angle between normals."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.volume.isosurface import Mesh

MAX_SLOPE = 3.0  # largest slope of a surface to a pixel
DEPTH_STEPS = 1 << 20  # depth steps per world unit, to compare points of one pixel


@dataclass(frozen=True, eq=False)
class Points:
    """Places on a surface."""

    places: Tensor  # [N, 3] float64, world units
    normals: Tensor  # [N, 3] unit length, outwards

    def __getitem__(self, kept: Tensor) -> "Points":
        """Select points by a mask [N] or indices."""
        return Points(self.places[kept], self.normals[kept])


@dataclass(frozen=True)
class SurfaceErrors:
    """Errors of a mesh against a surface."""

    accuracy: float  # mean distance of the mesh from the surface, world units
    completeness: float  # mean distance of the surface from the mesh
    precision: float  # share of the mesh within the tolerance
    recall: float  # share of the surface within the tolerance
    normal_angle: float  # mean angle to the normal of the nearest place, both ways, degrees

    @property
    def chamfer(self) -> float:
        """Return the mean of both distances, world units."""
        return (self.accuracy + self.completeness) / 2

    @property
    def f_score(self) -> float:
        """Return the harmonic mean of precision and recall, in [0, 1]."""
        return 2 * self.precision * self.recall / max(self.precision + self.recall, 1e-12)


def sample(mesh: Mesh, count: int, seed: int = 0) -> Points:
    """Sample a mesh uniformly by area."""
    a, b, c = mesh.corners.transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    areas = np.linalg.norm(normals, axis=1)
    if not areas.sum() > 0:
        raise ArgumentError("mesh: expected triangles with an area, got none")
    rng = np.random.default_rng(seed)
    chosen = rng.choice(len(areas), size=count, p=areas / areas.sum())
    # Uniform on a triangle: Osada et al. 2002, equation 1.
    s, t = np.sqrt(rng.random(count))[:, None], rng.random(count)[:, None]
    places = (1 - s) * a[chosen] + s * (1 - t) * b[chosen] + s * t * c[chosen]
    return Points(torch.from_numpy(places), torch.from_numpy(normals[chosen] / areas[chosen, None]))


def nearest(points: Tensor, camera: Camera) -> tuple[Tensor, Tensor, Tensor]:
    """Return the index [H * W] of the nearest of many points [N, 3] in each pixel, or -1.

    With it come the pixel of each point [N], -1 outside of the image, and their camera z [N].
    """
    places, z = camera.project(points)
    u, v = places.floor().long().unbind(1)
    on_image = (z > 0) & (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)
    pixel = torch.where(on_image, v * camera.width + u, -1)
    index = torch.arange(len(points))
    key = ((z * DEPTH_STEPS).long() << 32) + index
    first = torch.full((camera.width * camera.height,), torch.iinfo(torch.int64).max)
    first.scatter_reduce_(0, pixel[on_image], key[on_image], "amin")
    return torch.where(first < torch.iinfo(torch.int64).max, first & (2**32 - 1), -1), pixel, z


def are_visible(points: Points, cameras: Sequence[Camera], tolerance: float) -> Tensor:
    """Return which points [N] bool a camera sees: the nearest in their pixels, up to the tolerance."""
    is_seen = torch.zeros(len(points.places), dtype=torch.bool)
    for camera in cameras:
        first, pixel, z = nearest(points.places, camera)
        rays = camera.position.to(points.places) - points.places
        cosine = (rays * points.normals).sum(1) / rays.norm(dim=1)
        slope = (1 / cosine.square() - 1).clamp_min(0).sqrt().clamp_max(MAX_SLOPE)
        in_front = z[first[pixel.clamp_min(0)].clamp_min(0)]
        # A slanted surface has several depths in one pixel.
        margin = tolerance + 1.5 * slope * z / float(camera.K[0, 0])
        is_seen |= (pixel >= 0) & (cosine > 0) & (z <= in_front + margin)
    return is_seen


def compare(mesh: Points, surface: Points, tolerance: float) -> SurfaceErrors:
    """Return the errors of a mesh, from points on it and on the visible part of the true surface.

    Points within the tolerance, world units, count as correct.
    """
    for name, points in (("mesh", mesh), ("surface", surface)):
        if not len(points.places):
            raise ArgumentError(f"{name}: expected points to compare, got none; no training view sees it")
    forth, angles_forth = distances(mesh, surface)
    back, angles_back = distances(surface, mesh)
    return SurfaceErrors(
        float(forth.mean()),
        float(back.mean()),
        float((forth < tolerance).double().mean()),
        float((back < tolerance).double().mean()),
        float((angles_forth.mean() + angles_back.mean()) / 2),
    )


def distances(points: Points, others: Points) -> tuple[Tensor, Tensor]:
    """Return distances to the nearest of other points, world units, and angles of normals, degrees."""
    from scipy.spatial import cKDTree

    distance, index = cKDTree(others.places.numpy()).query(points.places.numpy(), workers=-1)
    cosine = (points.normals * others.normals[torch.from_numpy(index)]).sum(1).clamp(-1, 1)
    return torch.from_numpy(distance), cosine.acos().rad2deg()
