"""How many texels each surfel gets, from a budget or from what the views show of it."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from texgs.core.errors import ArgumentError
from texgs.core.progress import progress
from texgs.fields.bounds import visible_part
from texgs.fields.surfels.model import Surfels, geometry
from texgs.fields.surfels.texels import EXTENT
from texgs.raster import Texture, rasterize
from texgs.raster.arguments import MOST_TEXELS
from texgs.volume.images import Images


@dataclass(frozen=True, eq=False)
class Sight:
    """What the training views see of each surfel."""

    largest: Tensor
    """[N] largest blending weight in any view, 0 where no view shows the surfel."""
    pixel: Tensor
    """[N] side of a pixel at the surfel in the nearest view that shows it, world units; else infinite."""
    curvature: Tensor
    """[N] sum of weight * gain^2 over the pixels of a view that shows it. It bounds the sum of the surfel's
    rows of A'A 1, A being the weights of texels in pixels."""


@torch.no_grad()
def look(model: Surfels, images: Images, title: str) -> Sight:
    """Gather what all views show of a textured model, whatever its texels.

    A surfel seen by few views has a small mean curvature and still a large one where it is seen;
    `curvature` is therefore the mean over views weighted by itself, sum c^2 / sum c.
    """
    means = model.parameters["means"]
    n = len(means)
    largest, total, squares = means.new_zeros(3, n)
    pixel = means.new_full((n,), torch.inf)
    for index in progress(range(len(images)), title=f"{title}, sight", unit="view"):
        target = visible_part(images, index, model.parameters, model.shading.options)
        camera = target.camera
        texture = model.shading.colors(model.parameters, camera, target.light)
        if not isinstance(texture, Texture):
            raise ArgumentError(f"model: expected a texture, got stage {model.stage}; lay one out first")
        seen = rasterize(
            *geometry(model.parameters),
            camera.viewmat,
            camera.K,
            camera.width,
            camera.height,
            features=texture.gain[:, None],  # any: only the statistics count
            outputs=("statistics",),
            options=model.shading.options,
        ).statistics
        curvature = seen.weight_sum * texture.gain.square()  # type: ignore[union-attr]
        total += curvature
        squares += curvature.square()
        largest = torch.maximum(largest, seen.weight_max)  # type: ignore[union-attr]
        depth = means @ camera.viewmat[2, :3] + camera.viewmat[2, 3]
        here = torch.where(seen.weight_max > 0, depth / camera.K[0, 0], torch.inf)  # type: ignore[union-attr]
        pixel = torch.minimum(pixel, here)
    return Sight(largest, pixel, squares / total.clamp_min(torch.finfo(total.dtype).tiny))


def sizes_for_budget(scales: Tensor, texels: int) -> Tensor:
    """Texels along u and v [N, 2], int32, of the same edge for all surfels, about as many as asked in all.

    edge = sqrt(36 sum(s_u s_v) / texels), U = ceil(6 s_u / edge), V likewise. Rounding up adds a few, and a
    surfel has one at least.

    Args:
        scales: standard deviations [N, 2], world units.
        texels: of all surfels.
    """
    if texels < 1:
        raise ArgumentError(f"texels: expected at least 1, got {texels}")
    edge = (EXTENT**2 * scales.prod(dim=1).sum(dtype=torch.float64) / texels).sqrt().to(scales)
    return _sizes(scales, edge.expand(len(scales)))


def sizes_where_seen(scales: Tensor, sight: Sight) -> Tensor:
    """Texels along u and v [N, 2], int32, of about a pixel of the nearest view where a surfel is fully seen.

    The area of a texel grows as the largest blending weight falls: what hides behind others, and what no view
    shows, needs few. A surfel has one at least.

    Args:
        scales: standard deviations [N, 2], world units.
        sight: of the training views.
    """
    return _sizes(scales, sight.pixel / sight.largest.sqrt())


def _sizes(scales: Tensor, edges: Tensor) -> Tensor:
    counts = (EXTENT * scales / edges[:, None]).ceil().clamp_min(1)  # [N, 2]
    most = int(counts.double().prod(dim=1).max()) if len(counts) else 0
    if most > MOST_TEXELS:
        raise ArgumentError(f"texels: expected at most 2^24 for one surfel, got {most}; lower texels")
    return counts.int()


def offsets_of(sizes: Tensor) -> Tensor:
    """Index [N], int64, of each surfel's first texel, one surfel after the other.

    Args:
        sizes: texels along u and v [N, 2].
    """
    counts = sizes.long().prod(dim=1)
    return counts.cumsum(dim=0) - counts
