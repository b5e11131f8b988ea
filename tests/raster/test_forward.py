"""Every image of the native rasterizer against the float64 definition."""

from dataclasses import replace

import pytest
import torch

from tests.raster.agreement import decided, images, names_of, true_images
from tests.raster.scenes import (
    GAUSSIAN_OPTIONS,
    OTHER_OPTIONS,
    SURFEL_OPTIONS,
    TEXTURE_SIZES,
    described,
    gaussians,
    random_scene,
    textured,
    textured_with_features,
)
from texgs.raster.api import rasterize
from texgs.raster.types import DEFAULT_OPTIONS, Options

# Absolute tolerances. Colours and alpha are sums of numbers below 1 in float32, whose exponents carry the
# rounding of the intersection; depths are around 3; the distortion is at most 0.003 in these scenes.
TOLERANCE = {"color": 3e-5, "alpha": 3e-5, "depth": 3e-5, "median": 3e-5, "normal": 5e-5, "distortion": 1e-7}
TEXEL = 2e-6  # more for each texel that the textures span, as their random colours change from texel to texel
UNDECIDED = 0.15  # largest share of pixels that may sit on a threshold (or, textured, on a texel centre)


def check(scene, device, options=DEFAULT_OPTIONS):
    """Compare all images of a scene, pixel by pixel where the definition is sure."""
    outputs = [name for name in scene.outputs if name != "statistics"]
    rendered = images(scene.to(device).render(rasterize, outputs, options))
    expected = true_images(scene, outputs, options)
    sure = decided(scene, options)
    assert 1 - sure.double().mean() < UNDECIDED
    texels = 0 if scene.texture is None else int(scene.texture.sizes.max())
    for name in names_of(scene):
        assert rendered[name].shape == expected[name].shape
        assert rendered[name].dtype == torch.float32
        error = (rendered[name].cpu() - expected[name]).abs()
        tolerance = TOLERANCE[name] + (TEXEL * texels if name == "color" else 0)
        assert float(error[sure].max()) < tolerance, name
        assert sure.all() or (error[~sure] < 0.02).double().mean() > 0.9, name  # a weak fragment more or less


@pytest.mark.parametrize(
    ("seed", "n", "width", "height"), [(0, 150, 53, 37), (1, 300, 64, 48), (2, 400, 33, 71), (3, 200, 17, 1)]
)
def test_random_scenes(device, drawn, seed, n, width, height):
    check(drawn(random_scene(seed, n, width, height)), device)


@pytest.mark.parametrize("options", [*SURFEL_OPTIONS, *OTHER_OPTIONS], ids=described)
def test_options(device, options):
    check(random_scene(4), device, options)


@pytest.mark.parametrize("options", [*GAUSSIAN_OPTIONS, *OTHER_OPTIONS], ids=described)
def test_options_of_gaussians(device, options):
    check(gaussians(random_scene(4)), device, options)


@pytest.mark.parametrize("channels", [1, 3, 4, 7, 16, 32])
def test_channels(device, drawn, channels):
    check(drawn(random_scene(5, channels=channels)), device)


@pytest.mark.parametrize("sizes", [*([size] for size in TEXTURE_SIZES), TEXTURE_SIZES], ids=str)
def test_textures(device, sizes):
    check(textured(random_scene(6), sizes), device)


@pytest.mark.parametrize("channels", [1, 3, 4, 13, 29])
def test_textures_and_features(device, channels):
    scene = textured_with_features(random_scene(6), channels)
    check(scene, device)
    alone = replace(scene, features=None, background=scene.background[:3]).to(device).render(rasterize)
    beside = scene.to(device).render(rasterize)
    torch.testing.assert_close(beside.color[..., :3], alone.color, rtol=0, atol=1e-6)


def test_texture_on_unfiltered_and_narrow_surfels(device):
    check(textured(random_scene(7)), device, Options(low_pass=64.0, filter_sigma=1.0))


def test_black_background_by_default(device, drawn):
    check(drawn(replace(random_scene(8), background=None)), device)


def test_black_background_of_textures(device):
    check(textured(replace(random_scene(8), background=None)), device)


def test_shift(device, drawn):
    shift = 3 * torch.randn(200, 2, generator=torch.Generator().manual_seed(0))
    check(drawn(replace(random_scene(9), shift=shift)), device)


def test_only_what_is_asked_for(device, drawn):
    scene = drawn(random_scene()).to(device)
    render = scene.render(rasterize)
    assert render.depth is render.median is render.normal is render.distortion is render.statistics is None
    alone = scene.render(rasterize, ("depth",))
    together = scene.render(rasterize, scene.outputs)
    assert alone.normal is None
    torch.testing.assert_close(alone.depth, together.depth)
    torch.testing.assert_close(alone.color, together.color)
