"""Clicks on a view, or an outline, as points in space, and their visibility in other views."""

from dataclasses import dataclass

import torch
from torch import Tensor

from texgs.core import check
from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.core.geometry import quats_to_matrices
from texgs.fields.splats import REACH, geometry
from texgs.fields.surfels.model import Surfels

FAINT = 0.05  # alpha below which a click is on the background
TOLERANCE = 0.02  # in model extents: how far behind a surface a point still counts as on it


@dataclass(frozen=True, eq=False)
class Clicks:
    """Clicks or an outline in a rendered view; all tensors are on the model's device."""

    camera: Camera  # of the view
    points: Tensor  # [P, 2] right and down in pixels; the centre of the first pixel is (0.5, 0.5)
    positive: Tensor  # [P] bool, whether a point is on the object or beside it
    held: Tensor | None = None  # [H, W] bool, pixels inside an outline around the object

    def __post_init__(self) -> None:
        count = check.shape("points", self.points, "P 2")["P"]
        check.shape("positive", self.positive, "P", P=count)
        if self.held is None and not bool(self.positive.any()):
            raise ArgumentError("points: expected a positive one at least, got none; click on the object")


def inside_of(outline: Tensor, camera: Camera) -> Tensor:
    """Return the pixels [H, W] bool whose centres lie in an outline [V, 2], by the even-odd rule."""
    width, height, ends = camera.width, camera.height, outline.double()
    for x, y in ends.tolist():
        if not (0 <= x <= width and 0 <= y <= height):
            raise ArgumentError(f"outline: expected corners in {width} x {height} pixels, got ({x:g}, {y:g})")
    (x0, y0), (x1, y1) = (each.T[..., None] for each in (ends, ends.roll(-1, 0)))
    middle = torch.arange(height, device=ends.device) + 0.5
    edge, row = ((y0 <= middle) != (y1 <= middle)).nonzero(as_tuple=True)  # edges that cross the row
    column = (x0 + (middle - y0) * (x1 - x0) / (y1 - y0) - 0.5)[edge, row].ceil().clamp(0, width).long()
    crossed = ends.new_zeros(height, width + 1).index_put_((row, column), ends.new_ones(()), accumulate=True)
    inside = crossed.cumsum(dim=1)[:, :width] % 2 == 1
    if not bool(inside.any()):
        raise ArgumentError("outline: expected pixels inside of it, got none; draw it around the object")
    return inside


@torch.no_grad()
def places_of(model: Surfels, clicks: Clicks) -> Tensor:
    """Return the world positions [P, 3] of clicks, on the layer of surfels that dominates the pixel.

    A click passes through a layer that transmits more than it shows.
    """
    thickness = TOLERANCE * extent(model)
    places = [_place(model, clicks.camera, x, y, thickness) for x, y in clicks.points.tolist()]
    return torch.stack(places) if places else clicks.points.new_zeros(0, 3)


def _place(model: Surfels, camera: Camera, x: float, y: float, thickness: float) -> Tensor:
    """Return the intersection [3] of a pixel's ray with the layer that dominates the pixel."""
    if not (0 <= x < camera.width and 0 <= y < camera.height):
        raise ArgumentError(
            f"point ({x:g}, {y:g}): expected a place in the view of {camera.width} x {camera.height} pixels"
        )
    weights = weights_at(model, camera, int(x), int(y))
    alpha = float(weights.sum())
    if alpha < FAINT:
        raise ArgumentError(
            f"point ({x:g}, {y:g}): expected a place on the model, got background (alpha {alpha:.2f}); "
            "click on what is to be segmented"
        )
    shown = weights.nonzero()[:, 0]
    hits, depths = intersections(model, camera, x, y, shown)
    behind = depths[None] - depths[:, None]  # [K, K]
    layers = torch.where(
        (behind >= 0) & (behind <= thickness), weights[shown], 0.0
    )  # starting at each surfel
    layer = layers[layers.sum(dim=1).argmax()]
    return hits[layer.argmax()]


def weights_at(model: Surfels, camera: Camera, column: int, row: int) -> Tensor:
    """Return the blending weight [N] of each surfel in a pixel."""
    pixel = camera.crop(column, row, column + 1, row + 1)
    nothing = torch.zeros_like(model.parameters["opacities"])[:, None]
    seen = model.rasterized(pixel, features=nothing, outputs=("statistics",)).statistics
    assert seen is not None
    return seen.weight_sum


def intersections(
    model: Surfels, camera: Camera, x: float, y: float, surfels: Tensor
) -> tuple[Tensor, Tensor]:
    """Return the intersections [K, 3] of a pixel's ray with surfels, and their camera z [K].

    The low-pass filter draws surfels seen edge on, away from their planes; these give their means.
    """
    means, quats, scales, _ = (tensor[surfels] for tensor in geometry(model.parameters))
    normals = quats_to_matrices(quats)[:, :, 2]
    ray = camera.viewmat[:3, :3].T @ torch.linalg.inv(camera.K) @ means.new_tensor([x, y, 1.0])
    along = ((means - camera.position) * normals).sum(1) / (normals @ ray)
    hits = camera.position + along[:, None] * ray
    is_on_it = (hits - means).norm(dim=1) <= REACH * scales.amax(dim=1)
    hits = torch.where(is_on_it[:, None], hits, means)
    return hits, hits @ camera.viewmat[2, :3] + camera.viewmat[2, 3]


def is_visible(pixels: Tensor, depths: Tensor, median: Tensor, tolerance: float) -> Tensor:
    """Return which points [P] bool of a view more than half of the light reaches.

    They have pixels [P, 2] and camera z [P], which may be behind the rasterizer's median depth [H, W] by a
    tolerance in world units.
    """
    height, width = median.shape
    x, y = pixels.floor().unbind(1)
    inside = (x >= 0) & (x < width) & (y >= 0) & (y < height) & (depths > 0)
    limit = median[y.clamp(0, height - 1).long(), x.clamp(0, width - 1).long()]
    return inside & ((limit == 0) | (depths <= limit + tolerance))


def extent(model: Surfels) -> float:
    """Return the longest side of the box around the surfels' means, world units."""
    means = model.parameters["means"]
    return float((means.amax(0) - means.amin(0)).max()) if len(means) else 0.0
