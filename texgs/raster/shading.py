"""Colour of surfels: Blinn-Phong shading, and spherical harmonics that depend on the view."""

from collections.abc import Mapping, Sequence
from ctypes import c_float
from math import pi, sqrt
from typing import Any

import torch
from torch import Tensor

from texgs.core.errors import ShapeError
from texgs.raster import native
from texgs.raster.arguments import require

MATERIAL = ("ambient", "diffuse", "specular", "shininess")
Y00 = 0.5 / sqrt(pi)  # the constant harmonic
Ranges = Mapping[str, tuple[float, float]]
DEGREES = {1: 0, 4: 1, 9: 2, 16: 3}  # of spherical harmonics, by number of coefficients
native.declare("texgs_blinn_phong", "n ppppp i pppp ii pp")
native.declare("texgs_blinn_phong_backward", "n ppppp i pppp ii p pp ppppppp")
native.declare("texgs_spherical_harmonics", "n i ppp p")
native.declare("texgs_spherical_harmonics_backward", "n i ppp pp pp")


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
    ranges: Ranges | None = None,
) -> tuple[Tensor, Tensor]:
    """Shade surfels: color * (ambient + diffuse |n.l|) + specular |n.h|^shininess.

    n is the surfel's normal, l the direction to the light, h halfway between l and the direction v to the
    camera (Blinn 1977; the paper's eq. Blinn-Phong with white highlights). Both faces are lit alike and
    nothing is clamped. With `facing` only the face that the camera sees is, as renderers of volumes do: for n
    turned towards the camera, color * (ambient + diffuse max(n.l, 0)) + specular max(n.h, 0)^shininess, and
    the last term is there only where n.l > 0. For a light at the camera this is the same.

    Light is constant over a surfel, and shading affine in colour: a fragment with a texel, of color + texel,
    looks like base + gain * texel, see `Texture`.

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
        ranges: given, colours are clamped to [0, 1], and factors named here are given as raw numbers: they
            are low + (high - low) * sigmoid(number).

    Returns:
        base [N, 3], the shaded colours, and gain [N], ambient + diffuse |n.l| or what `facing` makes of it.
    """
    factors = zip(MATERIAL, (ambient, diffuse, specular, shininess), strict=True)
    material = {name: (x, name) for name, x in factors}  # each of a length of its own
    surfels = {"color": (color, "N 3"), **material, "means": (means, "N 3"), "quats": (quats, "N 4")}
    lights = {"camera_position": (camera_position, "3"), "light": (light, "3")}
    sizes = require(surfels | lights, constant=lights)
    for name in MATERIAL:
        if sizes[name] not in (sizes["N"], 1):
            raise ShapeError(f"{name}: expected [{sizes['N']}] or one for all [1], got [{sizes[name]}]")
    tensors = (x for x, _ in (*surfels.values(), *lights.values()))
    dense = (None if x is None else x.contiguous() for x in tensors)
    return _BlinnPhong.apply((facing, ranges is not None), ranges or {}, *dense)


class _BlinnPhong(torch.autograd.Function):
    """Autograd function of `blinn_phong`; arguments are its options, ranges and tensors."""

    @staticmethod
    def forward(ctx: Any, how: tuple, ranges: Ranges, color: Tensor, *others: Tensor) -> tuple[Tensor, ...]:
        numbers = zip(MATERIAL, others[:4], strict=True)
        factors = (between(*ranges[name], x) if name in ranges else x for name, x in numbers)
        tensors = (color, *factors, *others[4:])
        base, gain = torch.empty_like(color), color.new_empty(len(color))
        native.call("texgs_blinn_phong", *_arguments(tensors, how), base, gain, device=color.device)
        ctx.save_for_backward(*tensors)
        ctx.how, ctx.ranges = how, ranges
        ctx.set_materialize_grads(False)
        return base, gain

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, grad_base: Tensor | None, grad_gain: Tensor | None) -> tuple[Tensor | None, ...]:
        tensors = ctx.saved_tensors
        grad_base = torch.zeros_like(tensors[0]) if grad_base is None else grad_base.contiguous()
        grad_gain = None if grad_gain is None else grad_gain.contiguous()
        gradients = native.gradients(tensors, ctx.needs_input_grad[2:])
        limits = [ctx.ranges.get(name, (0.0, 0.0)) for name in MATERIAL]
        ranges = (c_float * 8)(*(x for low, high in limits for x in (low, high - low)))
        arguments = (*_arguments(tensors, ctx.how), ranges, grad_base, grad_gain, *gradients[:7])
        native.call("texgs_blinn_phong_backward", *arguments, device=grad_base.device)
        return None, None, *gradients


def _arguments(tensors: Sequence[Tensor], how: tuple) -> tuple:
    """Return the arguments of the library, with a bit for each shared factor of the material."""
    shared = sum(len(x) == 1 and 1 << k for k, x in enumerate(tensors[1:5]))
    return len(tensors[0]), *tensors[:5], shared, *tensors[5:], *how


def between(low: float, high: float, raw: Tensor) -> Tensor:
    """Map raw values to a range by a sigmoid; the range 0 to 1 needs no scaling."""
    values = raw.sigmoid()
    values = values if high - low == 1 else (high - low) * values
    return values if low == 0 else low + values


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
    """
    position = {"camera_position": (camera_position, "3")}
    sizes = require({"sh": (sh, "N K 3"), "means": (means, "N 3"), **position}, constant=position)
    if sizes["K"] not in DEGREES:
        raise ShapeError(f"sh: expected 1, 4, 9 or 16 coefficients, [N, K, 3], got {list(sh.shape)}")
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
        gradients = native.gradients((sh, means), ctx.needs_input_grad[:2])
        arguments = (*inputs, upstream.contiguous(), *gradients)
        native.call("texgs_spherical_harmonics_backward", *arguments, device=sh.device)
        return *gradients, None
