"""The loss of one view, with its gradients."""

from collections.abc import Mapping
from typing import Any, cast

import torch
from torch import Tensor

from texgs.fields.splats import GEOMETRY, Shading
from texgs.fields.surfels.shading import ShadingModel, material
from texgs.fitting.settings import Losses
from texgs.raster import arguments, native
from texgs.raster.autograd import SCENE, Gradients, Image, RasterView, SurfelTensors
from texgs.raster.losses import planar, scale
from texgs.raster.shading import MATERIAL
from texgs.volume.images import Target

MATERIAL_CHANNELS = len(MATERIAL)
Compared = native.struct("texgs_target", "p color alpha, f l1 dssim alpha_l1 alpha_dssim normal smoothness")
native.declare("texgs_rendered_loss", *SCENE, Image, Image, Compared, Gradients, "p")


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

    `shift_gradient` [N, 2], dense, receives that of shifts on screen in pixels. Iterations count from 1, as
    losses may start later. `turns_normals` says whether shading turns and moves surfels.
    """
    camera = target.camera
    fixed = {} if turns_normals else {name: parameters[name].detach() for name in ("means", "quats")}
    colors = cast(Tensor, shading.colors({**parameters, **fixed}, camera, target.light))  # no texture yet
    maps = material_maps(parameters, shading) if weights.smoothness > 0 else None
    features = colors if maps is None else torch.cat([colors, maps], dim=1)
    surfels = arguments.surfel_tensors([parameters[name] for name in GEOMETRY], None, features, None)
    outputs = ("normal", "depth") if weights.normal > 0 and iteration > weights.normal_from else ()
    seen = (camera.viewmat.contiguous(), camera.K.contiguous(), camera.width, camera.height)
    background = features.new_tensor([1.0] * 3 + [0.0] * (surfels.channels - 3))  # white behind colours
    view = RasterView(*seen, frozenset(outputs), shading.options, background, raw=True)
    tensors = (*surfels[:4], surfels.features)
    wanted = [torch.is_grad_enabled() and x is not None and x.requires_grad for x in tensors]
    observed = (shift_gradient, weights.alpha > 0)
    return _ViewLoss.apply(view, comparison(target, weights), observed, wanted, *tensors)


def comparison(target: Target, weights: Losses) -> native.Struct:
    """Return the targets of a view and the weights of its losses, as a structure of the library."""
    l1 = 1 - weights.dssim
    of_alpha = (weights.alpha * l1 * weights.alpha_l1, weights.alpha * weights.dssim)
    factors = (l1, weights.dssim, *of_alpha, weights.normal, weights.smoothness * MATERIAL_CHANNELS)
    return Compared(planar(target.color), target.alpha.contiguous(), *(target.share * x for x in factors))


class _ViewLoss(torch.autograd.Function):
    """Computes value and gradients together in the forward pass; autograd uses them once."""

    @staticmethod
    def forward(
        ctx: Any, view: RasterView, target: native.Struct, observed: tuple, wanted: list, *tensors: Tensor
    ) -> Tensor:
        surfels = SurfelTensors._make((*tensors[:4], None, tensors[4], *[None] * 3))
        images = view.images(surfels)
        by_image = {name: torch.empty_like(x) for name, x in images.items() if observed[1] or name != "alpha"}
        ctx.gradients = native.gradients(tensors, wanted)
        into = Gradients(*ctx.gradients[:4], observed[0], ctx.gradients[4]) if any(wanted) else None
        values = surfels.means.new_zeros(4)
        given = (*view.structures(surfels), Image(**images), Image(**by_image), target, into, values)
        native.call("texgs_rendered_loss", *given, device=values.device)
        return values.sum()

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, upstream: Tensor) -> tuple[Tensor | None, ...]:
        gradients, ctx.gradients = ctx.gradients, None  # autograd may add to returned tensors
        return *[None] * 4, *scale(gradients, upstream)


def material_maps(parameters: Mapping[str, Tensor], shading: Shading) -> Tensor | None:
    """Return the material of each surfel as features [N, 4], or None if shared or missing."""
    has_maps = "ambient" in parameters and len(parameters["ambient"]) > 1
    if not has_maps or not isinstance(shading, ShadingModel):
        return None
    return torch.stack(list(material(parameters, shading.material).values()), dim=1)
