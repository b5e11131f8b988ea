"""The loss of a rendered view with all its gradients, in one pass: for loops with a step for each view."""

from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from texgs.core import check
from texgs.raster import arguments, native
from texgs.raster.autograd import SCENE, Gradients, Image, SurfelTensors, View
from texgs.raster.losses import planar, scaled
from texgs.raster.types import DEFAULT_OPTIONS, Options

NativeTarget = native.struct(
    "texgs_target", "p color alpha, f l1 dssim alpha_l1 alpha_dssim normal smoothness"
)
native.declare("texgs_rendered_loss", *SCENE, Image, Image, NativeTarget, Gradients, "p")


@dataclass(frozen=True, eq=False)
class Comparison:
    """What a view should look like, and how much each loss counts; see `texgs.raster.losses`."""

    color: Tensor  # [H, W, 3]
    alpha: Tensor  # [H, W]
    l1: float  # weight of mean |difference| of colour
    dssim: float  # weight of 1 - SSIM of colour
    alpha_l1: float = 0.0
    alpha_dssim: float = 0.0
    normal: float = 0.0  # weight of normal consistency
    smoothness: float = 0.0  # weight of bilateral smoothness of what features there are behind colours


def rendered_loss(
    geometry: tuple[Tensor, Tensor, Tensor, Tensor],
    features: Tensor,  # [N, C]
    camera: tuple[Tensor, Tensor, int, int],
    comparison: Comparison,
    *,
    background: Tensor,  # [C]
    shift_gradient: Tensor | None = None,  # [N, 2]
    options: Options = DEFAULT_OPTIONS,
) -> Tensor:
    """Render surfels or 3D Gaussians and compare the view: the sum of weighted losses [].

    The same as losses of what `rasterize` returns; but the gradients come with the value, so that autograd
    has one function to go back through, and that once.

    Args:
        geometry: means, quats, natural logarithms of scales, and logits of opacities; as models keep them.
        features: [N, C] colours [N, 3], and attributes behind them.
        camera: viewmat, K, width and height, as in `rasterize`.
        comparison: the target and weights.
        background: [C].
        shift_gradient: [N, 2] memory for the gradient of shifts on screen, in pixels.
        options: as in `rasterize`.
    """
    *matrices, width, height = camera
    surfels = arguments.surfel_tensors(geometry, None, features, None)
    outputs = ("normal", "depth") if comparison.normal > 0 else ()
    constants = (*matrices, background, None)
    view = arguments.view(surfels, constants, (width, height), None, outputs, options, raw=True)
    sides = {"H": height, "W": width}
    check.shape("color", comparison.color, "H W 3", **sides)
    check.shape("alpha", comparison.alpha, "H W", **sides)
    wanted = [torch.is_grad_enabled() and x is not None and x.requires_grad for x in surfels]
    return _RenderedLoss.apply(view, comparison, shift_gradient, wanted, *surfels)


class _RenderedLoss(torch.autograd.Function):
    """The gradients of what is wanted are there before they are asked for; autograd hands them on, once."""

    @staticmethod
    def forward(
        ctx: Any, view: View, c: Comparison, shift_gradient: Tensor | None, wanted: list[bool], *tensors: Any
    ) -> Tensor:
        surfels = SurfelTensors(*tensors)
        images = view.images(surfels)
        by_image = {name: torch.empty_like(image) for name, image in images.items()}
        if c.alpha_l1 == c.alpha_dssim == 0:
            del by_image["alpha"]
        weights = (c.l1, c.dssim, c.alpha_l1, c.alpha_dssim, c.normal, c.smoothness)
        target = NativeTarget(planar(c.color), c.alpha.contiguous(), *weights)
        ctx.gradients = SurfelTensors(*native.gradients(surfels, wanted))
        into = Gradients(*ctx.gradients._replace(shift=shift_gradient)) if any(wanted) else None
        values = surfels.means.new_zeros(4)
        given = (*view.structures(surfels), Image(**images), Image(**by_image), target, into, values)
        native.call("texgs_rendered_loss", *given, device=values.device)
        return values.sum()

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, upstream: Tensor) -> tuple[Tensor | None, ...]:
        gradients, ctx.gradients = ctx.gradients, None  # autograd may add to what it is handed
        return None, None, None, None, *scaled(gradients, upstream)
