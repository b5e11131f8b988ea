"""Texels by Adam on L1 + D-SSIM and sparsity, as the paper fits them."""

from __future__ import annotations

import torch
from torch import Tensor

from texgs.core.errors import FitError
from texgs.core.progress import progress
from texgs.fit.images import Images, Target
from texgs.raster import Texture, rasterize
from texgs.raster.ssim import l1_dssim
from texgs.scene.model import Model, geometry
from texgs.scene.render import render

RATE = 0.0025  # of Adam at the start
FINAL = 0.1  # rate at the end, relative to the start
DSSIM = 0.2


def refine(model: Model, images: Images, *, iterations: int, sparsity: float, seed: int, title: str) -> Model:
    """Fit the texels to one view after the other by L1 + D-SSIM.

    Args:
        model: textured, texels where to start.
        images: training views.
        iterations: views, one each.
        sparsity: weight of the mean absolute value of the rendered texels, without shading.
        seed: of the order of views.
        title: of the progress bar.

    Raises:
        FitError: if texels are no longer finite.
    """
    texels = model.parameters["texels"].clone().requires_grad_()
    moving = Model({**model.parameters, "texels": texels}, model.optics, model.metadata)
    adam = torch.optim.Adam([texels], eps=1e-15, fused=True)
    generator = torch.Generator().manual_seed(seed)
    order: list[int] = []
    for iteration in progress(range(iterations), title=title, unit="iteration"):
        if not order:
            order = torch.randperm(len(images), generator=generator).tolist()
        target = images.target(order.pop(), texels.device)
        loss = l1_dssim(render(moving, target.camera, target.light).color, target.color, DSSIM)
        if sparsity > 0:
            loss = loss + sparsity * texel_map(moving, target).abs().mean()
        adam.param_groups[0]["lr"] = RATE * FINAL ** (iteration / iterations)
        loss.backward()
        adam.step()
        adam.zero_grad(set_to_none=True)
    if not bool(torch.isfinite(texels).all()):
        raise FitError(
            "texture: texels are not finite after Adam; look for values that are not in the model before"
        )
    return Model({**model.parameters, "texels": texels.detach()}, model.optics, model.metadata)


def texel_map(model: Model, target: Target) -> Tensor:
    """Texels [H, W, 3] as a view shows them: neither shaded nor added to anything, over black."""
    p, camera = model.parameters, target.camera
    means = p["means"]
    plain = Texture(
        torch.zeros_like(means), torch.ones_like(means[:, 0]), p["texels"], p["sizes"], p["offsets"]
    )
    return rasterize(
        *geometry(p),
        camera.viewmat,
        camera.K,
        camera.width,
        camera.height,
        texture=plain,
        options=model.optics.options,
    ).color
