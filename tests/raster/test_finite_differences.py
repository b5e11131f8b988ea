"""Gradients of the native rasterizer against finite differences of the float64 definition, thresholds off.

With thresholds on, an image jumps as a fragment passes 1/255, and differences of it are no derivative (10 to
20 % off per surfel). Off means 0 in the definition; the native one needs an alpha_min to bound surfels.
"""

from dataclasses import replace

import pytest
import torch

from tests.raster.agreement import gradients, images, random_cotangents, relative
from tests.raster.scenes import few, gaussians, random_scene, textured
from texgs.raster.api import rasterize
from texgs.raster.reference import render as reference
from texgs.raster.types import Options

OFF = Options(alpha_min=0.0, transmittance_min=0.0)
ALMOST_OFF = Options(alpha_min=1e-9, transmittance_min=0.0)
STEP = 1e-6
TOLERANCE = 1e-3  # relative L2: float32 (5e-4 at worst, see test_gradients.py) and kinks within a step


def differences(scene, cotangents, options):
    """Central differences of sum(cotangent * image) for every element of every leaf."""

    def value(leaves):
        rendered = images(scene.with_leaves(leaves).render(reference.rasterize, tuple(cotangents), options))
        return sum((rendered[name] * cotangent).sum() for name, cotangent in cotangents.items())

    quotients = {}
    for name, leaf in scene.leaves().items():
        flat = torch.empty(leaf.numel(), dtype=torch.float64)
        for i in range(leaf.numel()):
            step = torch.zeros_like(leaf)
            step.view(-1)[i] = STEP
            flat[i] = (value({name: leaf + step}) - value({name: leaf - step})) / (2 * STEP)
        quotients[name] = flat.reshape(leaf.shape)
    return quotients


def visible(scene):
    """Pixels in which fragments below alpha_min do not matter, the depth being a ratio of weights."""
    return scene.double().render(reference.rasterize, options=OFF).alpha > 1e-3


def check(scene, device, names, **changes):
    """Compare all gradients of a scene."""
    cotangents = random_cotangents(scene, names, visible(scene))
    expected = differences(scene.double(), cotangents, replace(OFF, **changes))
    derivatives = gradients(rasterize, scene.to(device), cotangents, replace(ALMOST_OFF, **changes))
    for name, gradient in expected.items():
        if gradient.norm() > 1e-6:
            assert relative(derivatives[name], gradient) < TOLERANCE, name


def small(seed, n=8):
    """A scene of a few pixels: two renderings per element of every tensor are to take seconds."""
    scene = replace(few(seed, n, width=13, height=9), shift=torch.zeros(n, 2))
    return replace(scene, opacities=0.9 * scene.opacities)  # below the cap, which is a kink


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("names", [("color",), ("depth",)], ids=",".join)
def test_images(device, drawn, seed, names):
    check(drawn(small(seed)), device, names)


@pytest.mark.parametrize("seed", [0, 1])
def test_normal_and_alpha(device, seed):
    check(small(seed), device, ("normal", "alpha"))


def test_distortion(device, drawn):
    check(
        drawn(small(2)), device, ("distortion",), near=1.0, far=6.0
    )  # spreads the depths over the range of m


@pytest.mark.parametrize("dilation", [0.1, 2.0])
def test_antialiased(device, dilation):
    scene = gaussians(small(6))
    check(replace(scene, scales=0.3 * scene.scales), device, ("color",), antialiased=True, dilation=dilation)


@pytest.mark.parametrize("filter_sigma", [0.0, 1.0, 3.0])
def test_low_pass_centre(device, filter_sigma):
    scene = small(3)
    check(replace(scene, scales=0.2 * scene.scales), device, ("color",), filter_sigma=filter_sigma)


def test_texture(device):
    scene = textured(small(4), sizes=[(1, 1), (2, 3), (4, 4), (5, 2)])
    check(scene, device, ("color",))


def test_direction_in_a_larger_scene(device, drawn):
    scene = drawn(random_scene(5, n=150))
    scene = replace(scene, opacities=0.9 * scene.opacities, shift=torch.zeros(150, 2))
    cotangents = random_cotangents(scene, ("color", "depth"), visible(scene))
    derivatives = gradients(rasterize, scene.to(device), cotangents, ALMOST_OFF)
    generator = torch.Generator().manual_seed(0)
    for name, leaf in scene.double().leaves().items():
        direction = torch.randn(leaf.shape, generator=generator, dtype=torch.float64)
        ends = []
        for sign in (1, -1):
            moved = scene.double().with_leaves({name: leaf + sign * 1e-7 * direction})
            rendered = images(moved.render(reference.rasterize, ("depth",), OFF))
            ends.append(sum((rendered[image] * cotangent).sum() for image, cotangent in cotangents.items()))
        slope = float(ends[0] - ends[1]) / 2e-7
        assert float((derivatives[name].cpu() * direction).sum()) == pytest.approx(slope, rel=5e-3), name
