"""Winograd's convolution against torch's in double precision, for gradients too."""

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch.nn import functional as F

from tests.raster.requirements import require_same_bits
from tests.refusals import refused
from texgs.core.errors import DeviceError, ShapeError
from texgs.raster.convolution import RectifiedConvolution

SIZES = st.tuples(*[st.integers(1, most) for most in (2, 40, 40, 23, 23)])


def case(sizes, seed=0):
    """A convolution that keeps the size of numbers, and images for it."""
    count, inputs, outputs, height, width = sizes
    generator = torch.Generator().manual_seed(seed)
    weight = (2 / (9 * inputs)) ** 0.5 * torch.randn(outputs, inputs, 3, 3, generator=generator)
    bias = 0.1 * torch.randn(outputs, generator=generator)
    return RectifiedConvolution(weight, bias), torch.randn(count, inputs, height, width, generator=generator)


def close(result, expected, sizes):
    """Within a rounding that follows the sizes of what is summed up: the sum may be nearly 0."""
    difference = result.double() - expected
    assert difference.norm() <= 5e-6 * sizes.norm()
    assert difference.abs().max() <= 5e-5 * sizes.max()


def sums(images, convolution):
    """In double precision, before the rectifier; and those of all terms without their signs."""
    terms = [x.detach().double() for x in (images, convolution.weight, convolution.bias)]
    return F.conv2d(*terms, padding=1), F.conv2d(*(x.abs() for x in terms), padding=1)


@settings(deadline=None, max_examples=60)
@given(SIZES, st.integers(0, 9))
def test_values_and_gradients(sizes, seed):
    convolution, images = case(sizes, seed)
    images.requires_grad_()
    outputs = convolution(images)
    expected, sizes = sums(images, convolution)
    close(outputs.detach(), expected.clamp(min=0), sizes)
    upstream = torch.randn(expected.shape, generator=torch.Generator().manual_seed(seed + 1))
    (gradient,) = torch.autograd.grad(outputs, images, upstream)
    # that of the same rectifier: sums near 0 may be rounded to either side
    terms = upstream.double() * (outputs > 0), convolution.weight.double()
    expected, sizes = (F.conv_transpose2d(*each, padding=1) for each in (terms, [x.abs() for x in terms]))
    close(gradient, expected, sizes)


@pytest.mark.parametrize("channels", [(64, 64), (144, 128), (512, 256)])
def test_many_tiles(channels):
    """Several batches, the last of them not full."""
    convolution, images = case((1, *channels, 61, 70))
    expected, sizes = sums(images, convolution)
    close(convolution(images), expected.clamp(min=0), sizes)


def test_any_layout_of_memory():
    convolution, images = case((2, 16, 32, 9, 14))
    expected = convolution(images)
    assert torch.equal(convolution(images.contiguous(memory_format=torch.channels_last)), expected)
    assert torch.equal(convolution(images.repeat(2, 2, 1, 1)[:2, :16]), expected)


def test_gradients_of_any_layout():
    """Of a part of what was joined, of a sum (one number for all), and with saved results reordered."""
    convolution, images = case((1, 16, 32, 9, 14))
    images.requires_grad_()
    outputs = convolution(images)
    (expected,) = torch.autograd.grad(outputs, images, torch.ones_like(outputs))
    (of_sum,) = torch.autograd.grad(convolution(images).sum(), images)
    joined = torch.cat([convolution(images), convolution(images)], dim=1)
    (of_part,) = torch.autograd.grad(joined, images, torch.cat([torch.ones_like(outputs)] * 2, dim=1) / 2)
    with torch.autograd.graph.saved_tensors_hooks(lambda x: x.contiguous().clone(), lambda x: x):
        hooked = convolution(images)
    (of_hooked,) = torch.autograd.grad(hooked.sum(), images)
    for gradient in (of_sum, of_part, of_hooked):
        torch.testing.assert_close(gradient, expected, rtol=0, atol=1e-6)


def test_the_same_bits_for_any_number_of_threads():
    convolution, images = case((1, 48, 48, 90, 71))
    images.requires_grad_()

    def run():
        outputs = convolution(images)
        return outputs.detach(), torch.autograd.grad(outputs.square().sum(), images)[0]

    require_same_bits(run, threads=(2, 3, 7))


def test_what_is_no_number_stays_so():
    convolution, images = case((1, 3, 16, 12, 12))
    images[0, 1, 5, 6] = float("nan")
    outputs = convolution(images)
    assert outputs[0, :, 4:7, 5:8].isnan().all()
    assert outputs[0, :, 8:].isfinite().all()


def test_a_second_derivative_is_refused():
    convolution, images = case((1, 3, 16, 8, 8))
    images.requires_grad_()
    (gradient,) = torch.autograd.grad(convolution(images).square().sum(), images, create_graph=True)
    refused(gradient.sum().backward, "once_differentiable", RuntimeError)


def test_errors_name_the_argument():
    convolution, images = case((1, 3, 16, 8, 8))
    weight, bias = convolution.weight, convolution.bias
    learned = bias.clone().requires_grad_()
    refused(lambda: RectifiedConvolution(weight[..., :2], bias), "weight: ", ShapeError)
    refused(lambda: RectifiedConvolution(weight, bias[1:]), "bias: ", ShapeError)
    refused(lambda: RectifiedConvolution(weight.double(), bias), "weight: ")
    refused(lambda: RectifiedConvolution(weight, learned), "bias: not differentiable")
    refused(lambda: convolution(images[:, :2]), "images: ", ShapeError)
    refused(lambda: convolution(images[..., :0]), "image: ")
    refused(lambda: convolution(images.bfloat16()), "images: .* bfloat16")
    refused(lambda: convolution(images.to("meta")), "images: .* meta", DeviceError)
