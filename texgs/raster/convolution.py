"""Convolutions with constant 3x3 kernels, on the CPU, by Winograd's F(4x4, 3x3).

They take a quarter of the multiplications of a direct convolution (Lavin and Gray 2016). Relative errors are
2e-6 to 4e-6, about four times those of a direct one. Rounding, NaN and infinity reach up to 3 pixels farther
than kernels do.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import torch
from torch import Tensor
from torch.nn import functional as F

from texgs.raster import native
from texgs.raster.arguments import require

ON_GPU = "torch convolves on GPUs"
BLOCK = 16  # channels side by side in memory
TRANSFORM = (  # G of Lavin and Gray 2016, section 4.3
    (1 / 4, 0, 0),
    (-1 / 6, -1 / 6, -1 / 6),
    (-1 / 6, 1 / 6, -1 / 6),
    (1 / 24, 1 / 12, 1 / 6),
    (1 / 24, -1 / 12, 1 / 6),
    (0, 0, 1),
)
NativeConvolution = native.struct(
    "texgs_convolution", "i width height inputs outputs, p kernel bias, i is_rectified"
)
native.declare("texgs_convolve", NativeConvolution, "ppp")


@dataclass(frozen=True, eq=False)
class RectifiedConvolution:
    """max(0, weight * image + bias) with zeros around the image; differentiable once, in the image."""

    weight: Tensor  # [out, in, 3, 3] float32, constant
    bias: Tensor  # [out] float32, constant

    def __post_init__(self) -> None:
        given = {"weight": (self.weight, "outputs inputs 3 3"), "bias": (self.bias, "outputs")}
        require(given, constant=given, cpu=ON_GPU)

    def __call__(self, images: Tensor) -> Tensor:
        """Return [N, out, H, W] of images [N, in, H, W], both with channels last in memory.

        Images are copied where they have another order, or a number of channels that 16 does not divide. The
        result is not to be changed in place.
        """
        require({"images": (images, f"N {self.weight.shape[1]} H W")}, cpu=ON_GPU)
        return _Convolve.apply(images, self)

    @cached_property
    def kernel(self) -> Tensor:
        """The transformed weights, for the forward pass."""
        return transform_kernel(self.weight)

    @cached_property
    def adjoint(self) -> Tensor:
        """The weights for the backward pass: outputs and inputs swapped, each 3x3 rotated by half a turn."""
        return transform_kernel(self.weight.transpose(0, 1).flip(2, 3))

    @cached_property
    def padded_bias(self) -> Tensor:
        """The bias, padded with zeros to whole blocks."""
        return F.pad(self.bias, (0, -len(self.bias) % BLOCK)).contiguous()


def transform_kernel(weight: Tensor) -> Tensor:
    """Return G g G^T of each kernel g of [out, in, 3, 3], as [36, out / 16, in, 16], zero-padded."""
    outputs, inputs = weight.shape[:2]
    g = torch.tensor(TRANSFORM, dtype=torch.float64)
    padded = F.pad(weight, (0, 0, 0, 0, 0, -inputs % BLOCK, 0, -outputs % BLOCK))
    blocks = padded.reshape(-1, BLOCK, padded.shape[1], 9).permute(3, 0, 2, 1).contiguous()
    points = torch.kron(g, g).float() @ blocks.reshape(9, -1)  # [36, 9] and [9, out / 16, in, 16]
    return points.reshape(36, *blocks.shape[1:])


class _Convolve(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, images: Tensor, convolution: RectifiedConvolution) -> Tensor:
        ctx.convolution, ctx.inputs = convolution, images.shape[1]
        result = _call(convolution.kernel, images, None, convolution.padded_bias)
        ctx.save_for_backward(result)
        return result[:, : len(convolution.bias)]

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor, None]:
        (gate,) = ctx.saved_tensors
        gate = gate.contiguous(memory_format=torch.channels_last)  # hooks of saved tensors may reorder it
        return _call(ctx.convolution.adjoint, gradient, gate, None)[:, : ctx.inputs], None


def _call(kernel: Tensor, images: Tensor, gate: Tensor | None, bias: Tensor | None) -> Tensor:
    """Return [N, out, H, W] of whole blocks of channels, rectified where there is a bias."""
    inputs, outputs = kernel.shape[2], BLOCK * kernel.shape[1]
    images = F.pad(images, (0, 0, 0, 0, 0, inputs - images.shape[1])) if images.shape[1] < inputs else images
    images = images.contiguous(memory_format=torch.channels_last)
    count, _, height, width = images.shape
    result = images.new_empty(count, height, width, outputs)
    shape = NativeConvolution(width, height, inputs, outputs, kernel, bias, bias is not None)
    for index in range(count):
        planes = images[index], None if gate is None else gate[index], result[index]
        native.call("texgs_convolve", shape, *planes, device=torch.device("cpu"))
    return result.permute(0, 3, 1, 2)
