"""The loss of a rendered view with all its gradients, in one pass: for loops with a step for each view."""

from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.raster import arguments, native
from texgs.raster.autograd import SCENE, Gradients, Image, SurfelTensors, View
from texgs.raster.losses import planar, scaled
from texgs.raster.types import DEFAULT_OPTIONS, Options

NativeTarget = native.struct(
    "texgs_target", "p color alpha, f l1 dssim alpha_l1 alpha_dssim normal smoothness"
)
native.declare("texgs_rendered_loss", *SCENE, Image, Image, NativeTarget, Gradients, "p")


class Comparison(NamedTuple):
    """What a view should look like, and how much each loss counts; see `texgs.raster.losses`."""

    color: Tensor  # [H, W, 3] over white
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
    camera: Camera,
    comparison: Comparison,
    shift_gradient: Tensor | None = None,  # [N, 2]
    options: Options = DEFAULT_OPTIONS,
) -> Tensor:
    """Render surfels or 3D Gaussians over white and compare the view: the sum of weighted losses [].

    The same as losses of what `rasterize` returns; but the gradients come with the value, so that autograd
    has one function to go back through, and that once.

    Args:
        geometry: means, quats, natural logarithms of scales, and logits of opacities; as models keep them.
        features: [N, C] colours [N, 3], and attributes behind them, which are over 0.
        camera: one that `texgs.raster.arguments.pinhole` accepts, which is not asked again.
        comparison: the target and weights.
        shift_gradient: [N, 2] dense memory for the gradient of shifts on screen, in pixels.
        options: as in `rasterize`.
    """
    surfels = arguments.surfel_tensors(geometry, None, features, None)
    width, height, c = camera.width, camera.height, comparison
    fixed = {"viewmat": (camera.viewmat, "4 4"), "K": (camera.K, "3 3")}
    fixed |= {"color": (c.color, f"{height} {width} 3"), "alpha": (c.alpha, f"{height} {width}")}
    arguments.require({"means": (surfels.means, "N 3"), **fixed}, constant=fixed)
    outputs = frozenset(("normal", "depth") if c.normal > 0 else ())
    matrices = (camera.viewmat.contiguous(), camera.K.contiguous())
    behind = _background(surfels.channels, features.device)
    view = View(*matrices, width, height, outputs, options, behind, raw=True)
    tensors = (*surfels[: len(geometry)], surfels.features)
    wanted = [torch.is_grad_enabled() and x.requires_grad for x in tensors]
    return _RenderedLoss.apply(view, comparison, shift_gradient, wanted, *tensors)


@cache
def _background(channels: int, device: torch.device) -> Tensor:
    """Return white behind colours, and 0 behind attributes [channels]."""
    return torch.tensor([1.0] * 3 + [0.0] * (channels - 3), device=device)


class _RenderedLoss(torch.autograd.Function):
    """The gradients of what is wanted are there before they are asked for; autograd hands them on, once."""

    @staticmethod
    def forward(
        ctx: Any, view: View, c: Comparison, shift: Tensor | None, wanted: list[bool], *tensors: Tensor
    ) -> Tensor:
        surfels = _surfels(tensors)
        images = view.images(surfels)
        by_image = {name: torch.empty_like(image) for name, image in images.items()}
        if c.alpha_l1 == c.alpha_dssim == 0:
            del by_image["alpha"]
        target = NativeTarget(planar(c.color), c.alpha.contiguous(), *c[2:])
        ctx.gradients = native.gradients(tensors, wanted)
        into = Gradients(*_surfels(ctx.gradients, shift)) if any(wanted) else None
        values = surfels.means.new_zeros(4)
        given = (*view.structures(surfels), Image(**images), Image(**by_image), target, into, values)
        native.call("texgs_rendered_loss", *given, device=values.device)
        return values.sum()

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, upstream: Tensor) -> tuple[Tensor | None, ...]:
        gradients, ctx.gradients = ctx.gradients, None  # autograd may add to what it is handed
        return None, None, None, None, *scaled(gradients, upstream)


def _surfels(tensors: Sequence[Any], shift: Tensor | None = None) -> SurfelTensors:
    """Return means, quats, scales, opacities and features, or their gradients, by name."""
    *geometry, features = tensors
    return SurfelTensors(*geometry, shift, features)
