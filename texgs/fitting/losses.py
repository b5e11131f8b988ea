"""The loss of one view."""

from collections.abc import Mapping
from typing import Any, cast

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.fields.splats import Shading, Splats
from texgs.fields.surfels.shading import ShadingModel, material
from texgs.fitting.settings import Losses
from texgs.raster import Render
from texgs.raster.losses import bilateral_smoothness, l1_dssim, normal_consistency, ssim
from texgs.raster.shading import MATERIAL
from texgs.volume.images import Target

SMOOTHED = len(MATERIAL)


def view_loss(
    parameters: Mapping[str, Tensor],
    shading: Shading,
    target: Target,
    weights: Losses,
    shift: Tensor | None,
    iteration: int,
    turns_normals: bool = True,
) -> Tensor:
    """Render a view and compare it: L1 + D-SSIM of colour and alpha, normals, smooth material.

    `shift` [N, 2] are zeros that receive the screen-space gradient. Iterations count from 1, as losses may
    start later. `turns_normals` says whether shading has gradients into the surfels' orientation and place.
    """
    camera = target.camera
    fixed = {} if turns_normals else {name: parameters[name].detach() for name in ("means", "quats")}
    colors = cast(  # surfels have no texture yet
        Tensor, shading.colors({**parameters, **fixed}, camera, target.light)
    )
    maps = material_maps(parameters, shading) if weights.smoothness > 0 else None
    has_normals = weights.normal > 0 and iteration > weights.normal_from
    features = colors if maps is None else torch.cat([colors, maps], dim=1)
    outputs = ("normal", "depth") if has_normals else ()
    render = draw(parameters, features, shading, camera, shift=shift, outputs=outputs)
    # Split as planes, as they lie in memory: the gradient of a slice would be a whole image of zeros.
    channels = [3] if maps is None else [3, SMOOTHED]
    color, *attributes = (x.permute(1, 2, 0) for x in render.color.permute(2, 0, 1).split(channels))
    loss = l1_dssim(color, target.color, weights.dssim)
    if weights.alpha > 0:
        alphas = (render.alpha, target.alpha)
        only_dssim = not weights.alpha_l1
        apart = weights.dssim * (1 - ssim(*alphas)) if only_dssim else l1_dssim(*alphas, weights.dssim)
        loss = loss + weights.alpha * apart
    if has_normals:
        drawn = cast(tuple[Tensor, Tensor, Tensor], (render.normal, render.depth, render.alpha))
        loss = loss + weights.normal * normal_consistency(*drawn, camera.viewmat, camera.K)
    if attributes:
        smoothness = bilateral_smoothness(attributes[0], target.color, target.alpha)
        loss = loss + weights.smoothness * SMOOTHED * smoothness
    return target.share * loss


def render_view(parameters: Mapping[str, Tensor], shading: Shading, target: Target) -> Tensor:
    """Render the colours [H, W, 3] of a view over white."""
    colors = cast(Tensor, shading.colors(parameters, target.camera, target.light))
    return draw(parameters, colors, shading, target.camera).color


def draw(
    parameters: Mapping[str, Tensor], features: Tensor, shading: Shading, camera: Camera, **more: Any
) -> Render:
    """Render features [N, C] over white behind colours, and over 0 behind material."""
    background = features.new_zeros(features.shape[1])
    background[:3] = 1
    return Splats(parameters, shading).rasterized(camera, features=features, background=background, **more)


def material_maps(parameters: Mapping[str, Tensor], shading: Shading) -> Tensor | None:
    """Return the material of each surfel as features [N, 4]; None where all share one, or there is none."""
    has_maps = "ambient" in parameters and len(parameters["ambient"]) > 1
    if not has_maps or not isinstance(shading, ShadingModel):
        return None
    return torch.stack(list(material(parameters, shading.material).values()), dim=1)
