"""Fit texels to images by least squares or Adam; with geometry and shading frozen, images are linear."""

from collections.abc import Sequence
from dataclasses import replace
from math import ceil

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.progress import progress
from texgs.fields.optimizer import Optimizer, Rate
from texgs.fields.splats import visible_part
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.texels import footprint
from texgs.fitting.checkpoint import require_finite
from texgs.fitting.settings import TextureKeys
from texgs.raster import Texture
from texgs.raster.losses import l1_dssim
from texgs.volume.cameras import farthest_first
from texgs.volume.images import Images

FIRST_STEP = 1.3  # share of a Newton step in a typical view: 2 is the limit of stability, and views differ
LAST_STEP = 0.3  # noise of single views averages out as steps fall
MAX_TEXEL_CHANGE = 1.0  # largest texel; larger ones are noise from views that hardly see them
CHECKED_VIEWS = 12  # approximate number of views to choose the step length
STRUCTURE = 1e-3  # weight of D-SSIM against half the mean squared error
DSSIM = 0.2  # share of D-SSIM in the loss for Adam


def solve(
    model: Surfels, images: Images, of_surfels: Tensor, keys: TextureKeys, seed: int, title: str
) -> Surfels:
    """Fit the texels to all views: least squares, with a little D-SSIM, one view per step.

    A step divides the gradient by an estimate of the row sums A'A 1 of the Hessian in one view, A being the
    weights of texels in its pixels: by the row sums themselves, no eigenvalue would exceed 1. To the estimate
    `keys.ridge` times its median is added, which keeps texels that are hardly seen in place.
    `of_surfels` is the curvature [N] of the model, see `texels.Sight`. Texels follow the noise of views, too:
    they go as far as it helps other views, see `share_of`.
    """
    texels = model.parameters["texels"].clone().requires_grad_()
    moving = replace(model, parameters={**model.parameters, "texels": texels})
    scale = _inverse(curvature(model.parameters["sizes"], of_surfels), keys.ridge)
    generator = torch.Generator().manual_seed(seed)
    spread, count = farthest_first(images.cameras), ceil(keys.views * len(images))
    turns = [torch.randperm(count, generator=generator) for _ in range(keys.sweeps)]
    order = [spread[place] for place in torch.cat(turns).tolist()]
    for step, index in enumerate(progress(order, title=title, unit="view")):
        target = visible_part(images, index, model.parameters, model.shading.options)
        image = moving.render(target.camera, target.light).color
        structure = STRUCTURE * image.numel() * l1_dssim(image, target.color, 1.0)
        loss = 0.5 * (image - target.color).square().sum() + structure
        (gradient,) = torch.autograd.grad(loss, texels)
        rate = FIRST_STEP * (LAST_STEP / FIRST_STEP) ** (step / len(order))
        with torch.no_grad():
            texels.addcmul_(gradient, scale, value=-rate).clamp_(-MAX_TEXEL_CHANGE, MAX_TEXEL_CHANGE)
    advice = "the training views or the model of the phase before are damaged"
    require_finite("texture", {"texels": texels}, advice)
    solved = replace(model, parameters={**model.parameters, "texels": texels.detach()})
    share = share_of(solved, model, images, sorted(spread[count:]) or range(len(images)))
    kept = model.parameters["texels"].lerp(texels.detach(), share)
    return replace(model, parameters={**model.parameters, "texels": kept})


@torch.no_grad()
def share_of(solved: Surfels, start: Surfels, images: Images, views: Sequence[int]) -> float:
    """Return the step length in [0, 1] from a model to its solution with the least squared error.

    Images are linear in texels: it is <residual, change> / <change, change> over some `CHECKED_VIEWS` views.
    """
    along = across = 0.0
    for index in views[:: max(1, len(views) // CHECKED_VIEWS)]:
        target = visible_part(images, index, start.parameters, start.shading.options)
        before = start.render(target.camera, target.light).color
        change = solved.render(target.camera, target.light).color - before
        along += float((change * (target.color - before)).sum(dtype=torch.float64))
        across += float(change.square().sum(dtype=torch.float64))
    return min(max(along / across, 0.0), 1.0) if across else 0.0


def curvature(sizes: Tensor, of_surfels: Tensor) -> Tensor:
    """Return the share [T, 1] of each texel in the curvature [N] of its surfel, in their order."""
    owner = torch.repeat_interleave(sizes.long().prod(dim=1))  # [T]
    return (footprint(sizes) * of_surfels[owner])[:, None]


def _inverse(curvatures: Tensor, ridge: float) -> Tensor:
    """Return 1 / (curvature + ridge * median) [T, 1], or 0 if nothing is visible."""
    seen = curvatures[curvatures > 0]
    if not len(seen):
        return torch.zeros_like(curvatures)
    damped = curvatures + ridge * seen.median()
    return torch.where(damped > 0, 1 / damped, 0.0)


def refine(model: Surfels, images: Images, keys: TextureKeys, seed: int, title: str) -> Surfels:
    """Fit the texels, and the palette with them, to one view after the other by L1 + D-SSIM and sparsity.

    As the paper fits them. A colour without light is palette + offset + texel. The palette has the gradients
    of all colours together and takes up what they have in common; texels take up how they differ. The palette
    remains a colour in [0, 1]; without a rate it stays.
    """
    rates = {"texels": Rate(keys.rate, keys.final)}
    if keys.palette_rate:
        rates["palette"] = Rate(keys.palette_rate, keys.final)
    optimizer = Optimizer({name: model.parameters[name] for name in ("texels", "palette")}, rates)
    moving = replace(model, parameters={**model.parameters, **optimizer.parameters})
    generator = torch.Generator().manual_seed(seed)
    order: list[int] = []
    for iteration in progress(range(keys.iterations), title=title, unit="iteration"):
        if not order:
            order = torch.randperm(len(images), generator=generator).tolist()
        target = visible_part(images, order.pop(), model.parameters, model.shading.options)
        image = moving.render(target.camera, target.light).color
        loss = l1_dssim(image, target.color, DSSIM)
        if keys.sparsity > 0:
            loss = loss + keys.sparsity * texel_map(moving, target.camera).abs().mean()
        (target.share * loss).backward()
        optimizer.step(iteration / keys.iterations)
        with torch.no_grad():
            optimizer.parameters["palette"].clamp_(0, 1)
    fitted = {name: x.detach() for name, x in optimizer.parameters.items()}
    require_finite("texture", fitted, "look for values that are not in the model before")
    return replace(model, parameters={**model.parameters, **fitted})


def texel_map(model: Surfels, camera: Camera) -> Tensor:
    """Render the texels alone, without palette, offsets and light, over 0 [H, W, 3].

    The paper's rendered colour map of c_tex (section Recolorable Textures and PSE); differentiable in texels.
    """
    p = model.parameters
    black = torch.zeros_like(p["means"])
    texture = Texture(black, torch.ones_like(p["opacities"]), p["texels"], p["sizes"], p["offsets"])
    return model.rasterized(camera, texture=texture).color
