"""The loss of a rendered view with all its gradients, in one pass: for loops with a step for each view."""

from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from texgs.raster import arguments, native
from texgs.raster.autograd import SurfelTensors, View, differentiate, render
from texgs.raster.losses import planar
from texgs.raster.types import DEFAULT_OPTIONS, Options

COLORS = 3  # channels that are colour; others are attributes


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
    targets = {"color": (comparison.color, f"{height} {width} 3"), "alpha": (comparison.alpha, f"{height} {width}")}
    arguments.require({"means": (surfels.means, "N 3"), **targets}, constant=targets)
    wanted = [torch.is_grad_enabled() and x is not None and x.requires_grad for x in surfels]
    return _RenderedLoss.apply(view, comparison, shift_gradient, wanted, *surfels)


class _RenderedLoss(torch.autograd.Function):
    @staticmethod
    def forward(
        ctx: Any,
        view: View,
        comparison: Comparison,
        shift_gradient: Tensor | None,
        wanted: list[bool],
        *tensors: Any,
    ) -> Tensor:
        surfels = SurfelTensors(*tensors)
        images, frame = render(surfels, view, {})
        by_image = {name: torch.empty_like(image) for name, image in images.items()}
        loss = _compare(comparison, view, images, by_image)
        if any(wanted):
            gradients = SurfelTensors(*native.gradients(surfels, wanted))
            into = gradients._replace(shift=shift_gradient)
            differentiate(frame, surfels, view, images, by_image, into)
            ctx.gradients = gradients
        return loss

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, upstream: Tensor) -> tuple[Tensor | None, ...]:
        gradients, ctx.gradients = ctx.gradients, None  # autograd may add to what it is handed
        # A weight of 1 is common and scaling a pass; looking at it would make a GPU wait.
        if upstream.device.type != "cpu" or upstream.item() != 1.0:
            gradients = [g if g is None else g.mul_(upstream) for g in gradients]
        return None, None, None, None, *gradients


def _compare(
    c: Comparison, view: View, images: dict[str, Tensor], by_image: dict[str, Tensor]
) -> Tensor:
    """Return the sum of losses, and write the gradients of images; those without one are left out."""
    color, alpha = images["color"], images["alpha"]
    target, target_alpha = planar(c.color), c.alpha.contiguous()
    size, values = (view.height, view.width), color.new_zeros(4)
    calls = [("texgs_l1_dssim", color, target, COLORS, *size, c.l1, c.dssim, values[0], by_image["color"])]
    if c.alpha_l1 > 0 or c.alpha_dssim > 0:
        weights = (c.alpha_l1, c.alpha_dssim)
        calls.append(("texgs_l1_dssim", alpha, target_alpha, 1, *size, *weights, values[1], by_image["alpha"]))
    else:
        del by_image["alpha"]
    if c.normal > 0:
        drawn = (images["normal"], images["depth"], alpha, view.viewmat, view.K)
        results = (values[2], by_image["normal"], by_image["depth"])
        calls.append(("texgs_normal_consistency", *drawn, *size, c.normal, *results))
    if attributes := len(color) - COLORS:
        maps, results = color[COLORS:], (values[3], by_image["color"][COLORS:])
        calls.append(("texgs_bilateral_smoothness", maps, target, target_alpha, attributes, *size, c.smoothness, *results))
    for name, *given in calls:
        native.call(name, *given, device=color.device)
    return values.sum()
