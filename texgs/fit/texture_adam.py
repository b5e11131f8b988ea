"""Texels by Adam on L1 + D-SSIM and sparsity, as the paper fits them."""

from __future__ import annotations

import torch

from texgs.core.errors import FitError
from texgs.core.progress import progress
from texgs.fields.bounds import visible_part
from texgs.fields.surfels.groups import TEXTURE
from texgs.fields.surfels.model import Surfels
from texgs.raster.ssim import l1_dssim
from texgs.volume.images import Images

FINAL = 0.1  # rate at the end, relative to the start
DSSIM = 0.2


def refine(
    model: Surfels, images: Images, *, iterations: int, rate: float, sparsity: float, seed: int, title: str
) -> Surfels:
    """Fit the texels to one view after the other by L1 + D-SSIM.

    Args:
        model: textured, texels where to start.
        images: training views.
        iterations: views, one each.
        rate: of Adam at the start; it falls to a tenth.
        sparsity: weight of the mean absolute value of what the texels add to the image.
        seed: of the order of views.
        title: of the progress bar.

    Raises:
        FitError: if texels are no longer finite.
    """
    texels = model.parameters["texels"].clone().requires_grad_()
    moving = Surfels({**model.parameters, "texels": texels}, model.shading, model.metadata)
    plain = without_texture(model)
    adam = torch.optim.Adam([texels], eps=1e-15, fused=True)
    generator = torch.Generator().manual_seed(seed)
    order: list[int] = []
    for iteration in progress(range(iterations), title=title, unit="iteration"):
        if not order:
            order = torch.randperm(len(images), generator=generator).tolist()
        target = visible_part(images, order.pop(), model.parameters, model.shading.options)
        image = moving.render(target.camera, target.light).color
        loss = l1_dssim(image, target.color, DSSIM)
        if sparsity > 0:
            with torch.no_grad():
                without = plain.render(target.camera, target.light).color
            loss = loss + sparsity * (image - without).abs().mean()
        adam.param_groups[0]["lr"] = rate * FINAL ** (iteration / iterations)
        (target.share * loss).backward()
        adam.step()
        adam.zero_grad(set_to_none=True)
    if not bool(torch.isfinite(texels).all()):
        raise FitError(
            "texture: texels are not finite after Adam; look for values that are not in the model before"
        )
    return Surfels({**model.parameters, "texels": texels.detach()}, model.shading, model.metadata)


def without_texture(model: Surfels) -> Surfels:
    """The same model with all texels 0, of stage shading: what texels add to an image is the difference."""
    p = {name: x for name, x in model.parameters.items() if name not in TEXTURE}
    p["colors"] = p["colors"] + model.parameters["palette"]
    return Surfels(p, model.shading, model.metadata)
