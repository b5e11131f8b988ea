"""Surface normals from a depth map, and their agreement with the blended normals."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from texgs.raster import arguments, native
from texgs.raster.losses import fused_loss, planar

native.declare("texgs_depth_to_normal", "ppp ii p")
native.declare("texgs_depth_to_normal_backward", "ppp ii pp")
native.declare("texgs_normal_consistency", "ppppp ii ppp")


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

    Raises:
        ShapeError, ArgumentError, DeviceError: naming the argument at fault.
    """
    _require(depth, viewmat, K)
    normal = _DepthToNormal.apply(depth.contiguous(), viewmat.contiguous(), K.contiguous())
    return normal.permute(1, 2, 0)


def normal_consistency(normal: Tensor, depth: Tensor, alpha: Tensor, viewmat: Tensor, K: Tensor) -> Tensor:
    """Normal consistency loss of 2DGS: mean over pixels of 1 - alpha * normal . depth_to_normal(depth).

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

    Raises:
        ShapeError, ArgumentError, DeviceError: naming the argument at fault.
    """
    _require(depth, viewmat, K, normal=(normal, "H W 3"), alpha=(alpha, "H W"))
    constants = [alpha.detach().contiguous(), viewmat.contiguous(), K.contiguous()]
    return fused_loss("texgs_normal_consistency", [planar(normal), depth.contiguous()], constants)


def _require(depth: Tensor, viewmat: Tensor, K: Tensor, **others: tuple[Tensor, str]) -> None:
    camera = {"viewmat": (viewmat, "4 4"), "K": (K, "3 3")}
    arguments.require_image({"depth": (depth, "H W"), **camera, **others}, constant=camera)
    arguments.pinhole(viewmat, K)


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
