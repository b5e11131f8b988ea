"""Blinn-Phong shading of surfels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import torch
from torch import Tensor

from texgs.core import check
from texgs.core.errors import ShapeError
from texgs.raster import native

MATERIAL = ("ambient", "diffuse", "specular", "shininess")
native.declare("texgs_blinn_phong", "n ppppp i pppp i pp")
native.declare("texgs_blinn_phong_backward", "n ppppp i pppp i pp ppppppp")


def blinn_phong(
    color: Tensor,  # [N, 3]
    ambient: Tensor,  # [N] or [1]
    diffuse: Tensor,  # [N] or [1]
    specular: Tensor,  # [N] or [1]
    shininess: Tensor,  # [N] or [1]
    means: Tensor,  # [N, 3]
    quats: Tensor,  # [N, 4]
    camera_position: Tensor,  # [3]
    light: Tensor | None = None,  # [3]
    *,
    facing: bool = False,
) -> Tensor:
    """Shade surfels: color * (ambient + diffuse |n.l|) + specular |n.h|^shininess.

    n is the surfel's normal, l the direction to the light, h halfway between l and the direction v to the
    camera (Blinn 1977; the paper's eq. Blinn-Phong with white highlights). Both faces are lit alike and
    nothing is clamped. With `facing` only the face that the camera sees is, as renderers of volumes do: for n
    turned towards the camera, color * (ambient + diffuse max(n.l, 0)) + specular max(n.h, 0)^shininess, and
    the last term is there only where n.l > 0. For a light at the camera this is the same.

    Differentiable in every surfel tensor, through n and v in quats and means too, but not in the side that
    faces the camera; not in the camera or the light.

    Args:
        color: [N, 3] colours of the surfels without light.
        ambient: k_a, [N] or one for all [1].
        diffuse: k_d, [N] or [1].
        specular: k_s, [N] or [1].
        shininess: beta, [N] or [1], 0 or more.
        means: [N, 3] world units.
        quats: [N, 4] wxyz, of any length but zero; the third axis is the normal.
        camera_position: [3] world units.
        light: [3] direction to a light far away, of any length, or None for a light at the camera.
        facing: whether the light must be in front of the face that the camera sees.

    Returns:
        [N, 3] shaded colours.

    Raises:
        ShapeError, ArgumentError, DeviceError: naming the argument at fault.
    """
    material = (ambient, diffuse, specular, shininess)
    return blinn_phong_texture(color, *material, means, quats, camera_position, light, facing=facing)[0]


def blinn_phong_texture(
    color: Tensor,
    ambient: Tensor,
    diffuse: Tensor,
    specular: Tensor,
    shininess: Tensor,
    means: Tensor,
    quats: Tensor,
    camera_position: Tensor,
    light: Tensor | None = None,
    *,
    facing: bool = False,
) -> tuple[Tensor, Tensor]:
    """Shade textured surfels, whose colour is color + texel(u, v): the base and gain of `Texture`.

    Light is constant over a surfel and Blinn-Phong affine in colour, so that the shaded fragment is
    base + gain * texel with gain = ambient + diffuse |n.l|, or ambient + diffuse max(n.l, 0) with `facing`,
    and base = blinn_phong(color). Arguments, gradients and errors are those of `blinn_phong`.

    Returns:
        base [N, 3] and gain [N].
    """
    material = dict(zip(MATERIAL, (ambient, diffuse, specular, shininess), strict=True))
    surfels = {"color": color, **material, "means": means, "quats": quats}
    lights = {"camera_position": camera_position} | ({} if light is None else {"light": light})
    n = check.shape("means", means, "N 3")["N"]
    check.shape("color", color, "N 3", N=n)
    check.shape("quats", quats, "N 4", N=n)
    for name, tensor in lights.items():
        check.shape(name, tensor, "3")
    for name, tensor in (surfels | lights).items():
        check.floating(name, tensor)
        if name in material and tensor.shape not in ((n,), (1,)):
            raise ShapeError(f"{name}: expected [{n}] or one for all [1], got {list(tensor.shape)}")
    check.same_device(**surfels, **lights)
    check.constant(**lights)
    dense = [x.contiguous() for x in (*surfels.values(), *lights.values())]
    return _BlinnPhong.apply(facing, *dense)


class _BlinnPhong(torch.autograd.Function):
    """`facing`, then colour, material, means, quats, camera position and, unless at the camera, the light."""

    @staticmethod
    def forward(ctx: Any, facing: bool, *tensors: Tensor) -> tuple[Tensor, Tensor]:
        color = tensors[0]
        base, gain = torch.empty_like(color), color.new_empty(len(color))
        native.call("texgs_blinn_phong", *_arguments(tensors, facing), base, gain, device=color.device)
        ctx.save_for_backward(*tensors)
        ctx.facing = facing
        ctx.set_materialize_grads(False)
        return base, gain

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, grad_base: Tensor | None, grad_gain: Tensor | None) -> tuple[Tensor | None, ...]:
        tensors = ctx.saved_tensors
        grad_base = torch.zeros_like(tensors[0]) if grad_base is None else grad_base.contiguous()
        grad_gain = None if grad_gain is None else grad_gain.contiguous()
        wanted = zip(tensors, ctx.needs_input_grad[1:], strict=True)
        gradients = [torch.empty_like(x) if want else None for x, want in wanted]
        arguments = (*_arguments(tensors, ctx.facing), grad_base, grad_gain, *gradients[:7])
        native.call("texgs_blinn_phong_backward", *arguments, device=grad_base.device)
        return None, *gradients


def _arguments(tensors: Sequence[Tensor], facing: bool) -> tuple:
    """Surfels, colour, material, bits of what is shared of it, means, quats, camera, light and `facing`."""
    shared = sum(len(x) == 1 and 1 << k for k, x in enumerate(tensors[1:5]))
    light = tensors[8] if len(tensors) > 8 else None
    return len(tensors[0]), *tensors[:5], shared, *tensors[5:8], light, facing
