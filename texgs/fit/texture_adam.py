"""Texels and palette by Adam on L1 + D-SSIM and sparsity, as the paper fits them."""

from __future__ import annotations

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.errors import FitError
from texgs.core.progress import progress
from texgs.fields.bounds import visible_part
from texgs.fields.optimizer import Optimizer, Rate
from texgs.fields.surfels.model import Surfels, geometry
from texgs.raster import Texture, rasterize
from texgs.raster.losses import l1_dssim
from texgs.volume.images import Images

DSSIM = 0.2


def refine(
    model: Surfels,
    images: Images,
    *,
    iterations: int,
    rate: float,
    palette_rate: float,
    final: float,
    sparsity: float,
    seed: int,
    title: str,
) -> Surfels:
    """Fit the texels, and the palette with them, to one view after the other by L1 + D-SSIM.

    A colour without light is palette + offset + texel. The palette has the gradients of all colours together
    and takes up what they have in common; texels take up how they differ.

    Args:
        model: textured, texels and palette where to start.
        images: training views.
        iterations: views, one each.
        rate: of Adam at the start, of texels.
        palette_rate: the same of the palette, which remains a colour in [0, 1]; at 0 it stays.
        final: both rates at the end, relative to the start.
        sparsity: weight of the mean absolute value of the image of the texels alone, see `texel_map`.
        seed: of the order of views.
        title: of the progress bar.
    """
    rates = {"texels": Rate(rate, final)} | ({"palette": Rate(palette_rate, final)} if palette_rate else {})
    optimizer = Optimizer({name: model.parameters[name] for name in ("texels", "palette")}, rates)
    moving = Surfels({**model.parameters, **optimizer.parameters}, model.shading, model.metadata)
    generator = torch.Generator().manual_seed(seed)
    order: list[int] = []
    for iteration in progress(range(iterations), title=title, unit="iteration"):
        if not order:
            order = torch.randperm(len(images), generator=generator).tolist()
        target = visible_part(images, order.pop(), model.parameters, model.shading.options)
        image = moving.render(target.camera, target.light).color
        loss = l1_dssim(image, target.color, DSSIM)
        if sparsity > 0:
            loss = loss + sparsity * texel_map(moving, target.camera).abs().mean()
        (target.share * loss).backward()
        optimizer.step(iteration / iterations)
        with torch.no_grad():
            optimizer.parameters["palette"].clamp_(0, 1)
    if not all(bool(torch.isfinite(x).all()) for x in optimizer.parameters.values()):
        raise FitError(
            "texture: texels are not finite after Adam; look for values that are not in the model before"
        )
    fitted = {name: x.detach() for name, x in optimizer.parameters.items()}
    return Surfels({**model.parameters, **fitted}, model.shading, model.metadata)


def texel_map(model: Surfels, camera: Camera) -> Tensor:
    """The texels alone as a view shows them, without palette, offsets and light, over 0 [H, W, 3].

    The paper's rendered colour map of c_tex (section Recolorable Textures and PSE); differentiable in texels.
    """
    p = model.parameters
    black = torch.zeros_like(p["means"])
    seen = rasterize(
        *geometry(p),
        *(camera.viewmat, camera.K, camera.width, camera.height),
        texture=Texture(black, torch.ones_like(p["opacities"]), p["texels"], p["sizes"], p["offsets"]),
        options=model.shading.options,
    )
    return seen.color
