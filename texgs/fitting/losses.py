"""The loss of one view."""

from collections.abc import Mapping
from typing import cast

import torch
from torch import Tensor

from texgs.fields.splats import GEOMETRY, Shading, Splats
from texgs.fields.surfels.shading import ShadingModel, material
from texgs.fitting.settings import Losses
from texgs.raster.compared import Comparison, rendered_loss
from texgs.raster.shading import MATERIAL
from texgs.volume.images import Target

SMOOTHED = len(MATERIAL)


def view_loss(
    parameters: Mapping[str, Tensor],
    shading: Shading,
    target: Target,
    weights: Losses,
    shift_gradient: Tensor | None,
    iteration: int,
    turns_normals: bool = True,
) -> Tensor:
    """Render a view and compare it: L1 + D-SSIM of colour and alpha, normals, smooth material.

    `shift_gradient` [N, 2] receives the gradient of shifts on screen, in pixels. Iterations count from 1, as
    losses may start later. `turns_normals` says whether shading has gradients into the surfels' orientation
    and place.
    """
    camera = target.camera
    fixed = {} if turns_normals else {name: parameters[name].detach() for name in ("means", "quats")}
    colors = cast(  # surfels have no texture yet
        Tensor, shading.colors({**parameters, **fixed}, camera, target.light)
    )
    maps = material_maps(parameters, shading) if weights.smoothness > 0 else None
    has_normals = weights.normal > 0 and iteration > weights.normal_from
    features = colors if maps is None else torch.cat([colors, maps], dim=1)
    of_colors, of_alpha = target.share, target.share * weights.alpha
    comparison = Comparison(
        *(target.color, target.alpha),
        l1=of_colors * (1 - weights.dssim),
        dssim=of_colors * weights.dssim,
        alpha_l1=of_alpha * (1 - weights.dssim) if weights.alpha_l1 else 0.0,
        alpha_dssim=of_alpha * weights.dssim,
        normal=target.share * weights.normal if has_normals else 0.0,
        smoothness=target.share * weights.smoothness * SMOOTHED,
    )
    return rendered_loss(
        *(tuple(parameters[name] for name in GEOMETRY), features),
        *(camera, comparison, shift_gradient, shading.options),
    )


def render_view(parameters: Mapping[str, Tensor], shading: Shading, target: Target) -> Tensor:
    """Render the colours [H, W, 3] of a view over white."""
    return Splats(parameters, shading).render(target.camera, target.light).color


def material_maps(parameters: Mapping[str, Tensor], shading: Shading) -> Tensor | None:
    """Return the material of each surfel as features [N, 4]; None where all share one, or there is none."""
    has_maps = "ambient" in parameters and len(parameters["ambient"]) > 1
    if not has_maps or not isinstance(shading, ShadingModel):
        return None
    return torch.stack(list(material(parameters, shading.material).values()), dim=1)
