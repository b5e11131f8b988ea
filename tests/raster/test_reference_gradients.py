"""The definition's gradients, by autograd, against finite differences of itself with the thresholds off."""

from dataclasses import replace

import pytest
import torch

from texgs.raster.reference.render import rasterize, splat
from texgs.raster.types import Options, Texture

WIDTH, HEIGHT, N = 5, 4, 6
SMOOTH = Options(alpha_min=0.0, transmittance_min=0.0)
GEOMETRY = ("means", "quats", "scales", "opacities", "shift")


def inputs(seed=0):
    """A few large surfels that overlap in most pixels, each at a depth of its own."""
    generator = torch.Generator().manual_seed(seed)

    def rand(*shape):
        return torch.rand(*shape, generator=generator, dtype=torch.float64)

    means = torch.cat([rand(N, 2) - 0.5, 2 + 0.3 * torch.arange(N)[:, None]], 1)
    tensors = {
        "means": means,
        "quats": rand(N, 4) - 0.5,
        "scales": 0.2 + 0.5 * rand(N, 2),
        "opacities": 0.2 + 0.5 * rand(N),
        "shift": rand(N, 2) - 0.5,
        "features": rand(N, 2),
        "background": rand(2),
    }
    return {name: x.requires_grad_() for name, x in tensors.items()}


CAMERA = {
    "viewmat": torch.eye(4, dtype=torch.float64),
    "K": torch.tensor([[6.0, 0, 2.4], [0, 5.0, 2.1], [0, 0, 1]], dtype=torch.float64),
}
SIZE = {"width": WIDTH, "height": HEIGHT}


def check(tensors, output, options):
    """Compare the gradients of one image with finite differences."""

    def render(*values):
        given = dict(zip(tensors, values, strict=True))
        return getattr(rasterize(**CAMERA, **SIZE, **given, outputs=(output,), options=options), output)

    torch.autograd.gradcheck(render, tuple(tensors.values()), fast_mode=True)


@pytest.mark.parametrize("antialiased", [False, True])
@pytest.mark.parametrize("output", ["color", "alpha", "depth", "distortion"])
def test_gradients_of_every_output_of_gaussians(output, antialiased):
    tensors = inputs()
    thickness = 0.1 + torch.arange(N, dtype=torch.float64)[:, None] / 10
    tensors["scales"] = torch.cat([tensors["scales"].detach(), thickness], 1).requires_grad_()
    tensors["means"] = (tensors["means"].detach() + torch.tensor([0.0, 1.1, 0.0])).requires_grad_()
    check(tensors, output, replace(SMOOTH, antialiased=antialiased, dilation=0.5))


@pytest.mark.parametrize("filter_sigma", [0.0, 1.0, 3.0])
@pytest.mark.parametrize("output", ["color", "alpha", "depth", "normal", "distortion"])
def test_gradients_of_every_output(output, filter_sigma):
    check(inputs(), output, replace(SMOOTH, filter_sigma=filter_sigma))


def test_median_passes_its_gradient_to_the_depth_of_one_fragment():
    tensors = inputs()
    image = rasterize(**CAMERA, **SIZE, **tensors, outputs=("median",), options=SMOOTH)
    gradient = torch.autograd.grad(image.median.sum(), list(tensors.values()), allow_unused=True)
    by_name = dict(zip(tensors, gradient, strict=True))
    assert by_name["opacities"] is None or by_name["opacities"].count_nonzero() == 0
    step = 1e-6 * torch.randn(N, 3, generator=torch.Generator().manual_seed(1), dtype=torch.float64)
    medians = []
    for sign in (1, -1):
        moved = {**tensors, "means": tensors["means"] + sign * step}
        medians.append(rasterize(**CAMERA, **SIZE, **moved, outputs=("median",), options=SMOOTH).median.sum())
    expected = (by_name["means"] * step).sum()
    torch.testing.assert_close((medians[0] - medians[1]) / 2, expected, rtol=1e-5, atol=0)


def test_gradients_of_textured_surfels():
    tensors = inputs(seed=3)
    del tensors["features"], tensors["background"]
    generator = torch.Generator().manual_seed(4)
    sizes = torch.tensor([[1, 1], [2, 3], [4, 4], [1, 7], [5, 2], [3, 3]], dtype=torch.int32)
    count = sizes.prod(1)
    texels = torch.rand(int(count.sum()), 3, generator=generator, dtype=torch.float64)
    colors = {
        "base": torch.rand(N, 3, generator=generator, dtype=torch.float64),
        "gain": torch.rand(N, generator=generator, dtype=torch.float64),
        "texels": texels,
    }
    tensors |= {name: x.requires_grad_() for name, x in colors.items()}

    def render(*values):
        given = dict(zip(tensors, values, strict=True))
        color = {name: given.pop(name) for name in colors}
        texture = Texture(**color, sizes=sizes, offsets=count.cumsum(0) - count)
        return rasterize(**CAMERA, **SIZE, **given, texture=texture, options=SMOOTH).color

    torch.autograd.gradcheck(render, tuple(tensors.values()), fast_mode=True)


def test_gradients_of_splat():
    tensors = {name: x for name, x in inputs().items() if name in GEOMETRY and name != "shift"}
    image = torch.rand(HEIGHT, WIDTH, 2, dtype=torch.float64).requires_grad_()

    def sums(image, *values):
        return splat(image, **dict(zip(tensors, values, strict=True)), **CAMERA, options=SMOOTH)

    torch.autograd.gradcheck(sums, (image, *tensors.values()), fast_mode=True)
