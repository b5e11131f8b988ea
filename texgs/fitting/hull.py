"""The visual hull of views: the points that project onto something visible in every view."""

from math import ceil

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.fitting.rays import widen
from texgs.volume.images import Images

TRIED_POINTS = 200_000  # points to test at a time
ROUNDS = 20
SEARCHED_VOXELS = 64  # voxels along a side of the cube to search for the object

Box = tuple[Tensor, Tensor]  # lowest and highest corner [3]


def hull_points(images: Images, box: Box, count: int, generator: torch.Generator) -> Tensor:
    """Draw random points [count, 3] of the visual hull in a box; fewer if the hull is tiny."""
    inside: list[Tensor] = []
    for _ in range(ROUNDS):
        points = random_points(box, TRIED_POINTS, generator)
        for index, camera in enumerate(images.cameras):
            points = points[is_covered(images.planes[index, 3], camera, points)]
        inside.append(points)
        if sum(map(len, inside)) >= count:
            break
    if any(map(len, inside)):
        return torch.cat(inside)[:count]
    raise _empty(f"between {box[0].tolist()} and {box[1].tolist()}")


def _empty(where: str) -> ArgumentError:
    """Return the error for views with an empty visual hull."""
    return ArgumentError(
        f"visual hull: expected points that every view shows, found none {where}; do the views show anything "
        "there, and do their cameras agree?"
    )


def random_points(box: Box, count: int, generator: torch.Generator) -> Tensor:
    """Draw points [count, 3], uniform in the box."""
    low, high = box
    return low + (high - low) * torch.rand(count, 3, generator=generator)


def is_covered(alpha: Tensor, camera: Camera, points: Tensor) -> Tensor:
    """Return whether points [n, 3] fall on positive pixels of an image [H, W], or outside of it."""
    columns, rows, is_inside = project(camera, points)
    covered = torch.ones(len(points), dtype=torch.bool)
    covered[is_inside] = alpha[rows[is_inside], columns[is_inside]] > 0
    return covered


def project(camera: Camera, points: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Return column and row [n] of the pixels of points, and whether they are in the view."""
    places, z = camera.project(points)
    columns, rows = places.floor().long().unbind(dim=1)
    on_image = (columns >= 0) & (columns < camera.width) & (rows >= 0) & (rows < camera.height)
    return columns, rows, on_image & (z > 0)


def mean_colors(images: Images, points: Tensor) -> Tensor:
    """Return mean colours [n, 3] of the pixels of points, without the white behind; black if unseen."""
    total, weight = torch.zeros(len(points), 3), torch.zeros(len(points), 1)
    for index, camera in enumerate(images.cameras):
        columns, rows, is_inside = project(camera, points)
        pixels = images.planes[index][:, rows[is_inside], columns[is_inside]].T.float() / 255  # [m, 4]
        total[is_inside] += pixels[:, :3] - (1 - pixels[:, 3:])  # premultiplied
        weight[is_inside] += pixels[:, 3:]
    return (total / weight.clamp_min(1e-3)).clamp(0, 1)


def hull_box(images: Images, half_size: float) -> Box:
    """Return the box around the visual hull in a cube around the origin."""
    spacing = 2 * half_size / SEARCHED_VOXELS
    low = torch.full((3,), -half_size + spacing / 2)
    points = lattice([SEARCHED_VOXELS] * 3, low, spacing)
    inside = points[in_hull(images, points, spacing)]
    if not len(inside):
        raise _empty(f"within {half_size} of the origin")
    return inside.amin(0) - spacing, inside.amax(0) + spacing


def lattice(size: list[int], low: Tensor, spacing: float) -> Tensor:
    """Return world positions [X Y Z, 3] of all voxels."""
    return low + spacing * torch.cartesian_prod(*map(torch.arange, size))


def in_hull(images: Images, points: Tensor, spacing: float) -> Tensor:
    """Return whether points [n, 3] lie within about a spacing of something visible, in every view."""
    left = torch.arange(len(points))
    for index, camera in enumerate(images.cameras):
        nearest = float((points[left] - camera.position).norm(dim=1).amin()) if len(left) else 1.0
        pixels = min(
            ceil(0.5 * float(camera.K[0, 0]) * spacing / max(nearest, spacing)), min(images.size) // 2
        )
        alpha = widen(images.planes[index, 3], pixels)
        left = left[is_covered(alpha, camera, points[left])]
    inside = torch.zeros(len(points), dtype=torch.bool)
    inside[left] = True
    return inside
