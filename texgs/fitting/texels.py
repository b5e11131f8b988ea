"""The texture phase: surfels get texels; geometry and material stay."""

from dataclasses import dataclass, replace

import torch
from torch import Tensor

from texgs.core.errors import ArgumentError
from texgs.core.progress import progress
from texgs.fields.splats import visible_part
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.texels import EXTENT, offsets_of
from texgs.fitting.colors import mean_color
from texgs.fitting.settings import TextureKeys
from texgs.fitting.texture_solve import refine, solve
from texgs.raster import Texture
from texgs.raster.arguments import MAX_TEXELS
from texgs.volume.cameras import farthest_first
from texgs.volume.images import Images

SIGHT_VIEWS = 54  # evenly spread views to measure the visibility of surfels
HALVINGS = 40  # halvings of the interval of the texel edge


def texturize(
    model: Surfels, images: Images, keys: TextureKeys, seed: int = 0, title: str = "texture"
) -> Surfels:
    """Give the surfels of a relightable model textures (the paper's section Textured Gaussian Primitives).

    All other parameters stay. With the same seed of the order of views, machine and versions, results are
    the same.
    """
    if model.stage != "shading":
        raise ArgumentError(f"model: expected stage shading, got {model.stage}; pass what that stage wrote")
    palette = mean_color(images).to(model.device)
    n, scales = len(model), model.parameters["scales"].exp()
    flat = add_texture(model, palette, torch.ones(n, 2, dtype=torch.int32, device=scales.device))
    sight = gather_sight(flat, images, title)
    budget = keys.texels
    sizes = sizes_where_seen(scales, sight) if budget is None else sizes_for_budget(scales, budget)
    if keys.has_offset:
        palette = mean_unlit_color(model, sight)
    result = add_texture(model, palette, sizes)
    if not keys.has_offset:
        result = without_offset(result)
    if keys.sweeps:
        result = solve(result, images, sight.curvature, keys, seed, title)
    if keys.iterations:
        result = refine(result, images, keys, seed, title)
    return result


def add_texture(model: Surfels, palette: Tensor, sizes: Tensor) -> Surfels:
    """Add zero texels of sizes [N, 2] int32, and offsets from a palette [3]; the look does not change."""
    p = model.parameters
    texels = palette.new_zeros(int(sizes.long().prod(dim=1).sum()), 3)
    texture = {"palette": palette, "texels": texels, "sizes": sizes, "offsets": offsets_of(sizes)}
    return replace(model, parameters={**p, "colors": p["colors"] - palette, **texture})


def without_offset(model: Surfels) -> Surfels:
    """Move the offsets of surfels into their texels, which are in surfel order."""
    p = model.parameters
    owners = torch.repeat_interleave(p["sizes"].long().prod(dim=1))
    moved = {"texels": p["texels"] + p["colors"][owners], "colors": torch.zeros_like(p["colors"])}
    return replace(model, parameters={**p, **moved})


def mean_unlit_color(model: Surfels, sight: "Sight") -> Tensor:
    """Return the mean unlit colour [3] of a model, weighted by visibility in views."""
    shown = sight.shown[:, None]
    return ((shown * model.parameters["colors"]).sum(dim=0) / shown.sum().clamp_min(1e-12)).clamp(0, 1)


# -- how many texels a surfel gets ---


@dataclass(frozen=True, eq=False)
class Sight:
    """Visibility of each surfel in spread training views."""

    largest: Tensor
    """[N] largest blending weight in any view, 0 where no view shows the surfel."""
    pixel: Tensor
    """[N] side of a pixel at the surfel in the nearest view that shows it, world units; else infinite."""
    curvature: Tensor
    """[N] sum of weight * gain^2 over the pixels of a view that shows it. It bounds the sum of the surfel's
    rows of A'A 1, A being the weights of texels in pixels."""
    shown: Tensor
    """[N] sum of blending weights over these views."""


@torch.no_grad()
def gather_sight(model: Surfels, images: Images, title: str) -> Sight:
    """Measure the visibility of a textured model's surfels in `SIGHT_VIEWS` spread views.

    A surfel seen by few views has a small mean curvature and still a large one where it is seen;
    `curvature` is therefore the mean over views weighted by itself, sum c^2 / sum c, and at least half of
    the largest: lights from many sides let it vary so much that steps would be too long in bright views.
    """
    means = model.parameters["means"]
    n = len(means)
    largest, shown, total, squares, steepest = means.new_zeros(5, n)
    pixel = means.new_full((n,), torch.inf)
    for index in progress(farthest_first(images.cameras)[:SIGHT_VIEWS], title=f"{title}, sight", unit="view"):
        target = visible_part(images, index, model.parameters, model.shading.options)
        camera = target.camera
        texture = model.shading.colors(model.parameters, camera, target.light)
        if not isinstance(texture, Texture):
            raise ArgumentError(f"model: expected a texture, got stage {model.stage}; lay one out first")
        any_features = texture.gain[:, None]  # only the statistics count
        seen = model.rasterized(camera, features=any_features, outputs=("statistics",)).statistics
        curvature = seen.weight_sum * texture.gain.square()  # type: ignore[union-attr]
        shown += seen.weight_sum  # type: ignore[union-attr]
        total += curvature
        squares += curvature.square()
        steepest = torch.maximum(steepest, curvature)
        largest = torch.maximum(largest, seen.weight_max)  # type: ignore[union-attr]
        depth = means @ camera.viewmat[2, :3] + camera.viewmat[2, 3]
        here = torch.where(seen.weight_max > 0, depth / camera.K[0, 0], torch.inf)  # type: ignore[union-attr]
        pixel = torch.minimum(pixel, here)
    mean = squares / total.clamp_min(torch.finfo(total.dtype).tiny)
    return Sight(largest, pixel, torch.maximum(mean, steepest / 2), shown)


def sizes_for_budget(scales: Tensor, texels: int) -> Tensor:
    """Choose texels along u and v [N, 2], int32, of equal edge for all surfels, `texels` in all at most.

    U = ceil(6 s_u / edge), V likewise, for standard deviations [N, 2] in world units. The paper's edge,
    sqrt(36 sum(s_u s_v) / texels), exceeds the budget, as sizes are rounded up: this is the smallest one that
    keeps it. A surfel has one texel at least.
    """
    if texels < 1:
        raise ArgumentError(f"texels: expected at least 1, got {texels}")
    if not len(scales):
        return _sizes(scales, scales.new_ones(0))
    extents = EXTENT * scales.double()
    low, high = float((extents.prod(dim=1).sum() / texels).sqrt()), float(extents.max())
    for _ in range(HALVINGS):
        edge = (low + high) / 2
        fits = (extents / edge).ceil().clamp_min(1).prod(dim=1).sum() <= texels
        low, high = (low, edge) if fits else (edge, high)
    edges = torch.full((len(scales),), high, dtype=torch.float64, device=scales.device)
    return _sizes(scales.double(), edges)


def sizes_where_seen(scales: Tensor, sight: Sight) -> Tensor:
    """Choose texels along u and v [N, 2], int32, of about a pixel of the nearest view that fully sees them.

    The area of a texel grows as the largest blending weight falls: what hides behind others, and what no view
    shows, needs few. A surfel has one at least.
    """
    return _sizes(scales, sight.pixel / sight.largest.sqrt())


def _sizes(scales: Tensor, edges: Tensor) -> Tensor:
    counts = (EXTENT * scales / edges[:, None]).ceil().clamp_min(1)  # [N, 2]
    most = int(counts.double().prod(dim=1).max()) if len(counts) else 0
    if most > MAX_TEXELS:
        raise ArgumentError(f"texels: expected at most 2^24 for one surfel, got {most}; lower texels")
    return counts.int()
