"""Gradients of the native rasterizer against the float64 definition's autograd, all thresholds on."""

from dataclasses import replace

import pytest
import torch

from tests.raster.agreement import (
    IMAGES,
    decided,
    gradients,
    names_of,
    random_cotangents,
    relative,
    true_gradients,
)
from tests.raster.scenes import (
    GAUSSIAN_OPTIONS,
    SURFEL_OPTIONS,
    described,
    gaussians,
    random_scene,
    textured,
    textured_with_features,
)
from texgs.raster.api import rasterize
from texgs.raster.types import DEFAULT_OPTIONS

# Relative L2 per tensor. Colours enter linearly and only carry the rounding of the weights. Geometry is a sum
# of terms that cancel, led by few tilted surfels whose intersections lose digits; the definition itself, in
# float32, has errors up to 1e-4 (means) and 2e-4 (quats) on such scenes.
TOLERANCE = {
    "means": 5e-4,
    "quats": 1e-3,
    "scales": 2e-4,
    "opacities": 1e-4,
    "shift": 2e-4,
    "features": 5e-5,
    "base": 5e-5,
    "gain": 1e-4,
    "texels": 2e-4,
}


def check(scene, device, names=("color",), options=DEFAULT_OPTIONS, wanted=None):
    """Compare the gradients of random combinations of the images `names` in pixels off all thresholds."""
    cotangents = random_cotangents(scene, names, decided(scene, options))
    derivatives = gradients(rasterize, scene.to(device), cotangents, options, wanted)
    expected = true_gradients(scene, cotangents, options, wanted)
    for name, gradient in expected.items():
        assert derivatives[name].shape == gradient.shape
        assert derivatives[name].isfinite().all()
        if gradient.norm() < 1e-9:  # no influence but for rounding, as of the scales on the median depth
            assert derivatives[name].norm() < 1e-2, name
        else:
            assert relative(derivatives[name], gradient) < TOLERANCE[name], name


@pytest.mark.parametrize(
    ("seed", "n", "width", "height"), [(0, 150, 53, 37), (1, 300, 64, 48), (2, 400, 33, 71)]
)
def test_color(device, drawn, seed, n, width, height):
    check(drawn(random_scene(seed, n, width, height)), device)


@pytest.mark.parametrize("name", [name for name in IMAGES if name != "color"])
def test_each_other_image(device, name):
    check(random_scene(3), device, (name,))


@pytest.mark.parametrize("name", [name for name in IMAGES if name not in ("color", "normal")])
def test_each_other_image_of_gaussians(device, name):
    check(gaussians(random_scene(3)), device, (name,))


def test_all_images_together(device, drawn):
    scene = drawn(random_scene(4))
    check(scene, device, names_of(scene))


@pytest.mark.parametrize("channels", [1, 4, 7, 16, 32])
def test_channels(device, drawn, channels):
    check(drawn(random_scene(5, channels=channels)), device, ("color", "depth"))


@pytest.mark.parametrize("channels", [1, 2, 4, 5, 6])
def test_channels_beside_no_depth(device, drawn, channels):
    check(drawn(random_scene(5, channels=channels)), device)


@pytest.mark.parametrize("options", SURFEL_OPTIONS, ids=described)
def test_options(device, options):
    check(random_scene(6), device, ("color", "depth", "normal"), options)


@pytest.mark.parametrize("options", GAUSSIAN_OPTIONS, ids=described)
def test_options_of_gaussians(device, options):
    check(gaussians(random_scene(6)), device, ("color", "depth"), options)


def test_shift(device, drawn):
    shift = torch.randn(200, 2, generator=torch.Generator().manual_seed(0))
    check(drawn(replace(random_scene(7), shift=shift)), device, ("color", "depth"))
    check(drawn(replace(random_scene(7), shift=torch.zeros(200, 2))), device)


def test_textures(device):
    check(textured(random_scene(8)), device)  # geometry included, through the texture coordinates


@pytest.mark.parametrize("size", [(1, 1), (4, 4), (5, 3), (8, 8), (33, 7), (1, 200), (60, 50)], ids=str)
def test_one_texture_size(device, size):
    check(textured(random_scene(9), [size]), device, ("color", "depth"))


def test_textures_and_all_images(device):
    scene = textured(random_scene(10))
    check(replace(scene, shift=torch.zeros(200, 2)), device, IMAGES)


@pytest.mark.parametrize("channels", [1, 4, 29])
def test_textures_and_features(device, channels):
    scene = textured_with_features(random_scene(10), channels)
    check(scene, device)
    check(scene, device, ("color", "normal", "depth"))


@pytest.mark.parametrize("wanted", [("features",), ("texels",), ("features", "texels"), ("base", "features")])
def test_textures_and_features_on_frozen_geometry(device, wanted):
    check(textured_with_features(random_scene(12), 2), device, wanted=wanted)


@pytest.mark.parametrize(
    "wanted", [("features",), ("opacities",), ("means", "features"), ("quats", "scales")]
)
def test_some_gradients_only(device, drawn, wanted):
    scene = drawn(random_scene(11))
    names = [name for name in ("color", "normal") if name in names_of(scene)]
    check(scene, device, names, wanted=wanted)


@pytest.mark.parametrize("wanted", [("texels",), ("base", "gain"), ("gain", "texels", "opacities")])
def test_some_gradients_of_textures_only(device, wanted):
    check(textured(random_scene(12)), device, wanted=wanted)


def test_surfels_that_are_not_drawn_among_others(device, drawn):
    scene = drawn(random_scene(13))
    behind = scene.means - 10 * scene.viewmat[2, :3]
    check(replace(scene, means=torch.where(torch.arange(200)[:, None] % 3 == 0, behind, scene.means)), device)


def test_two_uses_of_one_image_and_two_images_of_one_scene(device, drawn):
    scene = drawn(random_scene(14)).to(device)
    means = scene.means.clone().requires_grad_()
    first = scene.with_leaves({"means": means}).render(rasterize)
    second = replace(scene.with_leaves({"means": means}), background=None).render(rasterize)
    both = torch.autograd.grad(first.color.sum() + (second.color**2).sum(), means, retain_graph=True)[0]
    one = torch.autograd.grad(first.color.sum(), means)[0]
    other = torch.autograd.grad((second.color**2).sum(), means)[0]
    torch.testing.assert_close(both, one + other)
