"""Where views show something: surfels that are seen after a quick fit to small images."""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor
from torch.nn.functional import avg_pool2d

from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.shading import ShadingModel, raw_material
from texgs.fit.loop import Fit
from texgs.fit.settings import Densify, Losses, Phase, Rates
from texgs.volume.images import Images, smaller

PIXELS = 200  # of the longer side of the small images, about
CANDIDATES = 2  # for each surfel that is kept
PHASE = Phase(
    iterations=100,
    rates=Rates(quats=0.016),
    losses=Losses(dssim=0.0, alpha=0.0),
    densify=Densify(start=0, stop=0),
)


def most_seen(
    surfels: Mapping[str, Tensor], colors: Tensor, images: Images, count: int, seed: int
) -> tuple[dict[str, Tensor], Tensor]:
    """Fit surfels for a moment and keep those that contribute most to all views together.

    Args:
        surfels: raw geometry, of more surfels than are wanted.
        colors: [N, 3] of the surfels.
        images: training views.
        count: of surfels to keep.
        seed: of the order of views.

    Returns:
        Raw geometry as fitted and colours [count, 3] in [0, 1]; fewer if there are not so many.
    """
    small = shrunk(images, max(images.planes.shape[2:]) // PIXELS)
    start = {**surfels, "colors": colors, **raw_material(0.5, 0.5, 0.1, 20.0, "bounded")}
    fit = Fit(start, ShadingModel(), small, PHASE, seed)
    for _ in fit.run():
        pass
    fitted = {name: x.detach() for name, x in fit.parameters.items()}
    best = shown(Surfels(fitted), small).topk(min(count, len(colors))).indices
    return {name: fitted[name][best] for name in surfels}, fitted["colors"][best].clamp(0, 1)


@torch.no_grad()
def shown(model: Surfels, images: Images) -> Tensor:
    """Sum [N] of the blending weights of each surfel over all pixels of all views."""
    total = torch.zeros(len(model))
    for camera, light in zip(images.cameras, images.lights, strict=True):
        statistics = model.render(camera, light, outputs=("statistics",)).statistics
        total += statistics.weight_sum  # type: ignore[union-attr]
    return total


def shrunk(images: Images, factor: int) -> Images:
    """Images of averages of factor x factor pixels; incomplete blocks at the right and bottom are cut off."""
    if factor <= 1:
        return images
    planes = torch.stack([avg_pool2d(view.float(), factor).round().to(torch.uint8) for view in images.planes])
    return Images(planes, [smaller(camera, factor) for camera in images.cameras], images.lights)
