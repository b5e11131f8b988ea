"""View-dependent colour of surfels from spherical harmonics."""

from __future__ import annotations

from math import pi, sqrt
from typing import Any

import torch
from torch import Tensor

from texgs.core import check
from texgs.core.errors import ShapeError
from texgs.raster import native

Y00 = 0.5 / sqrt(pi)  # the constant harmonic
DEGREES = {1: 0, 4: 1, 9: 2, 16: 3}  # by number of coefficients
native.declare("texgs_spherical_harmonics", "n i ppp p")
native.declare("texgs_spherical_harmonics_backward", "n i ppp pp pp")


def spherical_harmonics(sh: Tensor, means: Tensor, camera_position: Tensor) -> Tensor:
    """Return the colour of surfels seen from a point: max(0, 0.5 + sum_k sh_k Y_k(direction)).

    Real spherical harmonics in the order and with the signs of 3DGS; the direction leads from the camera to
    the mean (Kerbl et al. 2023). Differentiable in `sh` and `means`; no gradient passes where a colour is
    clamped to 0.

    Args:
        sh: [N, K, 3] coefficients, K = 1, 4, 9 or 16 for degree 0 to 3.
        means: [N, 3] world units.
        camera_position: [3] world units.

    Returns:
        [N, 3] colours, 0 or more.

    Raises:
        ShapeError, ArgumentError, DeviceError: naming the argument at fault.
    """
    sizes = check.shape("sh", sh, "N K 3")
    if sizes["K"] not in DEGREES:
        raise ShapeError(f"sh: expected 1, 4, 9 or 16 coefficients, [N, K, 3], got {list(sh.shape)}")
    check.shape("means", means, "N 3", **sizes)
    check.shape("camera_position", camera_position, "3")
    for name, tensor in (("sh", sh), ("means", means), ("camera_position", camera_position)):
        check.floating(name, tensor)
    check.same_device(sh=sh, means=means, camera_position=camera_position)
    check.constant(camera_position=camera_position)
    return _SphericalHarmonics.apply(sh.contiguous(), means.contiguous(), camera_position.contiguous())


class _SphericalHarmonics(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, sh: Tensor, means: Tensor, camera_position: Tensor) -> Tensor:
        color = torch.empty_like(means)
        inputs = (len(sh), DEGREES[sh.shape[1]], sh, means, camera_position)
        native.call("texgs_spherical_harmonics", *inputs, color, device=sh.device)
        ctx.save_for_backward(sh, means, camera_position, color)
        return color

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, upstream: Tensor) -> tuple[Tensor | None, ...]:
        sh, means, camera_position, color = ctx.saved_tensors
        inputs = (len(sh), DEGREES[sh.shape[1]], sh, means, camera_position, color)
        wanted = zip((sh, means), ctx.needs_input_grad, strict=False)
        gradients = [torch.empty_like(x) if want else None for x, want in wanted]
        arguments = (*inputs, upstream.contiguous(), *gradients)
        native.call("texgs_spherical_harmonics_backward", *arguments, device=sh.device)
        return *gradients, None
