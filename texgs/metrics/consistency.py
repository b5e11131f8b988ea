"""Multi-view consistency: warp views into each other by depth, and compare where both see the same."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import sqrt
from statistics import fmean
from typing import NamedTuple

import torch
from torch import Tensor

from texgs.core import check
from texgs.core.camera import Camera

SHORT_RANGE, LONG_RANGE = 1, 7  # distance of pairs in views, as usual for stylised scenes
OPAQUE_ALPHA = 0.5  # least alpha of a pixel that has a depth
TOLERANCE = 0.01  # largest difference in depth of the same point, relative to the depth

# Distance of an image [H, W, 3] from a view, such as LPIPS; they differ at most in a mask [H, W].
Perceptual = Callable[[Tensor, Tensor], float]


@dataclass(frozen=True, eq=False)
class SeenFrame:
    """One rendered view."""

    image: Tensor  # [H, W, 3] in [0, 1]
    depth: Tensor  # [H, W] camera z, world units
    alpha: Tensor  # [H, W]
    camera: Camera


class Difference(NamedTuple):
    """Differences of a pair of views in their common part."""

    square: float  # mean squared difference of colours
    distance: float | None  # perceptual, if measured


def mean_differences(pairs: Sequence[Difference]) -> tuple[float, float | None]:
    """Return the RMS difference of one or more pairs, and the mean distance."""
    squares, distances = zip(*pairs, strict=True)
    return sqrt(fmean(squares)), None if distances[0] is None else fmean(distances)


def difference(
    first: SeenFrame, second: SeenFrame, distance: Perceptual | None = None, tolerance: float = TOLERANCE
) -> Difference | None:
    """Compare a view with another one warped into it; None without a common part.

    What depends on the place of the viewer counts as inconsistent, highlights and headlights too: render
    without light to measure textures alone.

    Args:
        first: the view.
        second: the other one.
        distance: from the first; it sees that view with the compared pixels exchanged.
        tolerance: of depths, relative.
    """
    warped, same = warp(second, first, tolerance)
    if not bool(same.any()):
        return None
    square = float((warped - first.image)[same].double().square().mean())
    exchanged = torch.where(same[..., None], warped, first.image)
    return Difference(square, None if distance is None else distance(exchanged, same))


@torch.no_grad()
def warp(source: SeenFrame, target: SeenFrame, tolerance: float = TOLERANCE) -> tuple[Tensor, Tensor]:
    """Return colours [H, W, 3] of one view at the pixels of another, and where [H, W] both see one point.

    A pixel of the target is compared where it is opaque, its point is inside of the source, and the four
    pixels there are opaque and as far away as the point is, but for the relative tolerance. Colours are
    interpolated bilinearly.
    """
    from kornia.geometry import remap

    for frame in (source, target):
        size = {"H": frame.camera.height, "W": frame.camera.width}
        check.shape("image", frame.image, "H W 3", **size)
        check.shape("depth", frame.depth, "H W", **size)
        check.shape("alpha", frame.alpha, "H W", **size)
    pixels, z = source.camera.project(target.camera.unproject(target.depth))
    height, width = source.depth.shape
    x, y = (pixels - 0.5).unbind(-1)
    warped = remap(source.image.permute(2, 0, 1)[None], x[None], y[None], align_corners=True)
    inside = ((pixels >= 0.5) & (pixels <= pixels.new_tensor([width - 0.5, height - 0.5]))).all(-1)
    same = (target.alpha >= OPAQUE_ALPHA) & inside & (z > 0)
    column, row = (at.nan_to_num(0, 0, 0).floor().long() for at in (x, y))
    for down in (row, row + 1):
        for right in (column, column + 1):
            at = (down.clamp(0, height - 1), right.clamp(0, width - 1))
            same &= (source.alpha[at] >= OPAQUE_ALPHA) & ((source.depth[at] - z).abs() <= tolerance * z)
    return warped[0].permute(1, 2, 0), same
