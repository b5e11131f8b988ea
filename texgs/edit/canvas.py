"""The image that the losses of a style compare: the visible part of a view, over a backdrop."""

from collections.abc import Iterable, Sequence

import torch
from torch import Tensor

from texgs.core import check
from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.core.light import Light
from texgs.edit.recipe import Recipe
from texgs.fields.splats import screen_box
from texgs.fields.surfels.model import Surfels
from texgs.raster import Texture

VIEWS = 6  # views to measure the translucency of a scene
SEEN_ALPHA = 0.02  # alpha; fainter pixels are ignored
MARGIN, MULTIPLE = 4, 8  # pixels: margin around the visible part, divisor of its sides


def require_editable(model: Surfels, surfels: Tensor | None) -> None:
    """Require a textured model, and surfels [N] bool that may change, one at least; None for all."""
    if model.stage != "texture":
        raise ArgumentError(f"model: expected stage texture, got {model.stage}; fit its texture first")
    if surfels is None:
        return
    check.shape("surfels", surfels, "N", N=len(model))
    if surfels.dtype != torch.bool or not bool(surfels.any()):
        raise ArgumentError(
            f"surfels: expected at least one that may change as bool, got {int(surfels.sum())} "
            f"of {surfels.dtype}; choose a segment that is not empty"
        )


def paint(
    model: Surfels, texels: Tensor, camera: Camera, light: Light, recipe: Recipe, chosen: Tensor | None = None
) -> tuple[Tensor, Tensor, Tensor]:
    """Render a view, or the part of it that shows the model, as a recipe says; differentiable in the texels.

    Texels [T, 3] are in place of the model's own. Surfels are chosen by [N] bool, by default all.

    Returns:
        Premultiplied colours [3, h, w] over black, alpha [h, w], and the share of chosen surfels in it.
    """
    p = {**model.parameters, "texels": texels}
    part = visible_camera(model, camera) if recipe.cropped else camera
    if recipe.is_lit:
        texture = model.shading.colors(p, part, light)
    else:
        gain = torch.ones_like(p["opacities"])
        texture = Texture(p["colors"] + p["palette"], gain, texels, p["sizes"], p["offsets"])
    features = None if chosen is None else chosen.to(texels)[:, None]  # blended, they are the share
    render = model.rasterized(part, recipe.opacity, texture=texture, features=features)
    planes, alpha = render.color.permute(2, 0, 1), render.alpha
    rows, columns = visible_part(alpha) if recipe.cropped else (slice(None), slice(None))
    planes, alpha = planes[:, rows, columns], alpha[rows, columns]
    return planes[:3], alpha, alpha if chosen is None else planes[3].detach()


def visible_camera(model: Surfels, camera: Camera) -> Camera:
    """Crop a camera to the part of the view that can show surfels, at least one pixel."""
    box = screen_box(model.parameters, model.shading.options, camera)
    left, top = min(max(box.left, 0), camera.width - 1), min(max(box.top, 0), camera.height - 1)
    right, bottom = min(box.right, camera.width), min(box.bottom, camera.height)
    return camera.crop(left, top, max(right, left + 1), max(bottom, top + 1))


def visible_part(alpha: Tensor) -> tuple[slice, slice]:
    """Return rows and columns of the visible part of alpha [h, w], with a margin."""
    seen = alpha > SEEN_ALPHA
    return visible_range(seen.any(dim=1)), visible_range(seen.any(dim=0))


def visible_range(seen: Tensor) -> slice:
    """Return the range of true values in a row [n], widened to a multiple of pixels where possible."""
    used = seen.nonzero()[:, 0]
    if not len(used):
        return slice(0, min(MULTIPLE, len(seen)))
    start = max(0, int(used[0]) - MARGIN)
    size = int(used[-1]) + 1 + MARGIN - start
    stop = min(len(seen), start + -(-size // MULTIPLE) * MULTIPLE)
    return slice(start, stop)


def few_cameras(cameras: Sequence[Camera]) -> Sequence[Camera]:
    """Return a few evenly spread cameras, enough to measure opacity."""
    return cameras[:: -(-len(cameras) // VIEWS)]


@torch.no_grad()
def mean_alpha(model: Surfels, cameras: Sequence[Camera], opacity: float = 1.0) -> float:
    """Return the mean alpha of a few views of a model with a factor on its opacities, see `weighted_mean`."""
    parts = (visible_camera(model, camera.to(model.device)) for camera in few_cameras(cameras))
    nothing = model.parameters["means"][:, :1]
    return weighted_mean(model.rasterized(part, opacity, features=nothing).alpha for part in parts)


def weighted_mean(alphas: Iterable[Tensor]) -> float:
    """Return the mean alpha of pixels [h, w] of views, each weighted by its alpha; 1 where nothing shows.

    This weight makes the rim of an opaque object hardly count, and the background not at all.
    """
    total = square = 0.0
    for alpha in alphas:
        total, square = total + float(alpha.sum()), square + float(alpha.square().sum())
    return square / total if total > 0 else 1.0
