"""Losses of images: photometric, edge-aware smoothness, consistency of normals with depth; normals of depth.

The library returns the gradients of a loss along with its value.
"""

from collections.abc import Sequence
from typing import Any

import torch
from torch import Tensor

from texgs.core.errors import ArgumentError
from texgs.raster import native
from texgs.raster.arguments import pinhole, require

Loss = tuple[str, tuple[float, ...], list[bool]]  # function, size and weights, which inputs want a gradient
native.declare("texgs_l1_dssim", "pp iii ff pp")
native.declare("texgs_bilateral_smoothness", "ppp iii f pp")
native.declare("texgs_depth_to_normal", "ppp ii p")
native.declare("texgs_depth_to_normal_backward", "ppp ii pp")
native.declare("texgs_normal_consistency", "ppppp ii f ppp")


def ssim(image: Tensor, target: Tensor) -> Tensor:
    """Return the mean structural similarity of two images with values in [0, 1].

    Gaussian window of 11 x 11 pixels with sigma 1.5, zeros outside the image, C1 = 0.01^2, C2 = 0.03^2,
    averaged over pixels and channels (Wang et al. 2004, with the window and padding of 3DGS). Windows in
    which both images are equal cost almost nothing. Differentiable in `image`; for a loss take `l1_dssim`,
    which is one pass less.

    Args:
        image: [H, W, C] or [H, W]. Planar memory ([C, H, W] seen as [H, W, C], as the rasterizer returns) is
            not copied.
        target: the same shape.

    Returns:
        [] between -1 and 1; exactly 1 for equal images.
    """
    return 1.0 - _weighted(image, target, 0.0, 1.0)


def l1_dssim(image: Tensor, target: Tensor, lambda_dssim: float = 0.2) -> Tensor:
    """Return (1 - lambda) mean |image - target| + lambda (1 - SSIM), as 3DGS (Kerbl et al. 2023, eq. 7).

    Differentiable in `image`; pixels equal to the target have no L1 gradient. SSIM is that of `ssim`. Alpha
    is a second image: add `weight * l1_dssim(alpha, target_alpha)`.

    Args:
        image: [H, W, C] or [H, W], values in [0, 1]. Planar memory is not copied.
        target: the same shape.
        lambda_dssim: in [0, 1].

    Returns:
        [] 0 or more; exactly 0 for equal images.
    """
    if not 0.0 <= lambda_dssim <= 1.0:
        raise ArgumentError(f"lambda_dssim: expected 0 to 1, got {lambda_dssim}")
    return _weighted(image, target, 1.0 - lambda_dssim, lambda_dssim)


def planar(image: Tensor) -> Tensor:
    """Return [H, W, C] or [H, W] as dense [C, H, W]; no copy if memory is planar already."""
    return (image[None] if image.ndim == 2 else image.permute(2, 0, 1)).contiguous()


def _weighted(image: Tensor, target: Tensor, l1: float, dssim: float) -> Tensor:
    """Return l1 * mean |image - target| + dssim * (1 - SSIM), checked."""
    axes = _axes(image)
    require({"image": (image, axes), "target": (target, axes)}, constant=("target",))
    return fused_loss("texgs_l1_dssim", [planar(image)], [planar(target)], l1, dssim)


def _axes(image: Tensor) -> str:
    """Return the axes of an image with channels or without."""
    return "H W" if image.ndim == 2 else "H W C"


def bilateral_smoothness(attribute: Tensor, guide: Tensor, alpha: Tensor) -> Tensor:
    """Return the bilateral smoothness of attribute maps: mean of alpha * exp(-g(grey)) * g(attribute).

    g = |d/dx| + |d/dy| of each pixel by Sobel's 3 x 3 kernels, zeros outside the image; grey is the mean of
    the guide's channels. An attribute may change where the guide does (Gao et al. 2024; the paper's L_b).
    Linear in the scale of the attribute: an exponent of 0 to 50 counts fifty times as much as a factor of 0
    to 1.
    Differentiable in `attribute`.

    Args:
        attribute: [H, W] or [H, W, C] rendered attributes, averaged over channels. Planar memory is not
            copied.
        guide: [H, W, 3] ground-truth image in [0, 1].
        alpha: [H, W] ground-truth alpha in [0, 1].

    Returns:
        [] 0 or more.
    """
    given = {"attribute": (attribute, _axes(attribute)), "guide": (guide, "H W 3"), "alpha": (alpha, "H W")}
    require(given, constant=("guide", "alpha"))
    constants = [planar(guide), alpha.contiguous()]
    return fused_loss("texgs_bilateral_smoothness", [planar(attribute)], constants, 1.0)


def depth_to_normal(depth: Tensor, viewmat: Tensor, K: Tensor) -> Tensor:
    """Return the unit normals of the surface that a depth map samples.

    The cross product of central differences of the unprojected pixels (Huang et al. 2024, section 5); it
    faces the camera. Differentiable in `depth`.

    Args:
        depth: [H, W] camera z, world units; 0 or less where there is no surface.
        viewmat: [4, 4] world to camera, a rigid motion, OpenCV axes.
        K: [3, 3] intrinsics in pixels, without skew.

    Returns:
        [H, W, 3] in world axes; 0 at the border of the image and where one of the four neighbours has no
        depth (2DGS takes such a neighbour to lie at the camera).
    """
    _require(depth, viewmat, K)
    normal = _DepthToNormal.apply(depth.contiguous(), viewmat.contiguous(), K.contiguous())
    return normal.permute(1, 2, 0)


def normal_consistency(normal: Tensor, depth: Tensor, alpha: Tensor, viewmat: Tensor, K: Tensor) -> Tensor:
    """Return the mean over pixels of 1 - alpha * normal . depth_to_normal(depth): the normal loss of 2DGS.

    Surfels are pulled into the surface that they form together (Huang et al. 2024, eq. 14). Differentiable in
    `normal` and `depth`; alpha is a weight without a gradient, whether it requires one or not.

    Args:
        normal: [H, W, 3] blended world normals, as rendered.
        depth: [H, W] camera z, world units; 0 or less where there is no surface.
        alpha: [H, W] in [0, 1].
        viewmat: [4, 4] world to camera, a rigid motion, OpenCV axes.
        K: [3, 3] intrinsics in pixels, without skew.

    Returns:
        [] between 0 and 2.
    """
    _require(depth, viewmat, K, normal=(normal, "H W 3"), alpha=(alpha, "H W"))
    constants = [alpha.detach().contiguous(), viewmat.contiguous(), K.contiguous()]
    return fused_loss("texgs_normal_consistency", [planar(normal), depth.contiguous()], constants, 1.0)


def _require(depth: Tensor, viewmat: Tensor, K: Tensor, **others: tuple[Tensor, str]) -> None:
    """Check a depth map with its camera, and images of the same size."""
    camera = {"viewmat": (viewmat, "4 4"), "K": (K, "3 3")}
    require({"depth": (depth, "H W"), **camera, **others}, constant=camera)
    pinhole(viewmat, K)


def fused_loss(name: str, inputs: Sequence[Tensor], constants: Sequence[Tensor], *weights: float) -> Tensor:
    """Return the value [] of a loss of the library, differentiable once in `inputs`.

    Its arguments are inputs, constants, the size of the last input, weights, and where the value and the
    gradients of the inputs go. Autograd refuses a second backward pass after one of the tensors was changed.
    """
    wanted = [torch.is_grad_enabled() and x.requires_grad for x in inputs]
    return _FusedLoss.apply((name, (*inputs[-1].shape, *weights), wanted), *inputs, *constants)


class _FusedLoss(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, loss: Loss, *tensors: Tensor) -> Tensor:
        ctx.loss = loss
        value, ctx.gradients = _evaluate(loss, tensors)
        ctx.save_for_backward(*tensors)
        return value

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, upstream: Tensor) -> tuple[Tensor | None, ...]:
        # Autograd may add to returned tensors, so a second pass through a retained graph computes them again.
        gradients = ctx.gradients or _evaluate(ctx.loss, ctx.saved_tensors)[1]
        ctx.gradients = None
        constants = len(ctx.needs_input_grad) - 1 - len(gradients)
        return None, *scale(gradients, upstream), *[None] * constants


def scale(gradients: Sequence[Tensor | None], upstream: Tensor) -> Sequence[Tensor | None]:
    """Scale the gradients of a loss by the upstream gradient []."""
    # A weight of 1 is common and scaling a pass over the image; looking at it would make a GPU wait.
    if upstream.device.type == "cpu" and upstream.item() == 1.0:
        return gradients
    return [g if g is None else g.mul_(upstream) for g in gradients]


def _evaluate(loss: Loss, tensors: Sequence[Tensor]) -> tuple[Tensor, list[Tensor | None]]:
    """Return the value [] of a loss, and the wanted gradients of its first tensors."""
    name, numbers, wanted = loss
    value = tensors[0].new_empty(())
    gradients = native.gradients(tensors[: len(wanted)], wanted)
    native.call(name, *tensors, *numbers, value, *gradients, device=value.device)
    return value, gradients


class _DepthToNormal(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, depth: Tensor, viewmat: Tensor, K: Tensor) -> Tensor:
        normal = depth.new_empty(3, *depth.shape)
        native.call("texgs_depth_to_normal", depth, viewmat, K, *depth.shape, normal, device=depth.device)
        ctx.save_for_backward(depth, viewmat, K)
        return normal

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, upstream: Tensor) -> tuple[Tensor | None, ...]:
        depth, viewmat, K = ctx.saved_tensors
        gradient = torch.empty_like(depth)
        inputs = (depth, viewmat, K, *depth.shape, upstream.contiguous())
        native.call("texgs_depth_to_normal_backward", *inputs, gradient, device=depth.device)
        return gradient, None, None
