"""The visual hull of views: the points that project onto something visible in every view."""

from __future__ import annotations

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.volume.images import Images

TRIED = 200_000  # points at a time
ROUNDS = 20

Box = tuple[Tensor, Tensor]  # lowest and highest corner [3]


def hull_points(images: Images, box: Box, count: int, generator: torch.Generator) -> Tensor:
    """Draw random points of the box that project onto something visible in every view.

    Args:
        images: views with alpha.
        box: where to look, world units.
        count: of points.
        generator: of random numbers.

    Returns:
        [count, 3], or fewer where the hull is but a tiny part of the box.
    """
    inside: list[Tensor] = []
    for _ in range(ROUNDS):
        points = random_points(box, TRIED, generator)
        for index, camera in enumerate(images.cameras):
            points = points[is_covered(images.planes[index, 3], camera, points)]
        inside.append(points)
        if sum(map(len, inside)) >= count:
            break
    if any(map(len, inside)):
        return torch.cat(inside)[:count]
    raise ArgumentError(
        f"visual hull: expected points that every view shows, found none between {box[0].tolist()} and "
        f"{box[1].tolist()}; do the views show anything there, and do their cameras agree?"
    )


def random_points(box: Box, count: int, generator: torch.Generator) -> Tensor:
    """Points [count, 3], uniform in the box."""
    low, high = box
    return low + (high - low) * torch.rand(count, 3, generator=generator)


def is_covered(alpha: Tensor, camera: Camera, points: Tensor) -> Tensor:
    """Whether points [n, 3] fall on pixels of an image [H, W] above 0; those outside of the view do."""
    columns, rows, is_inside = project(camera, points)
    covered = torch.ones(len(points), dtype=torch.bool)
    covered[is_inside] = alpha[rows[is_inside], columns[is_inside]] > 0
    return covered


def project(camera: Camera, points: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Column and row [n] of the pixels that points fall on, and whether these are in the view."""
    places, z = camera.project(points)
    columns, rows = places.floor().long().unbind(dim=1)
    on_image = (columns >= 0) & (columns < camera.width) & (rows >= 0) & (rows < camera.height)
    return columns, rows, on_image & (z > 0)


def mean_colors(images: Images, points: Tensor) -> Tensor:
    """Mean colour [n, 3] of the pixels that points project to, without the white behind; black if unseen."""
    total, weight = torch.zeros(len(points), 3), torch.zeros(len(points), 1)
    for index, camera in enumerate(images.cameras):
        columns, rows, is_inside = project(camera, points)
        pixels = images.planes[index][:, rows[is_inside], columns[is_inside]].T.float() / 255  # [m, 4]
        total[is_inside] += pixels[:, :3] - (1 - pixels[:, 3:])  # premultiplied
        weight[is_inside] += pixels[:, 3:]
    return (total / weight.clamp_min(1e-3)).clamp(0, 1)
