"""Scenes that rasterizers get wrong: the right images and gradients where defined, and finite numbers."""

from dataclasses import replace

import pytest
import torch

from tests.raster.agreement import (
    decided,
    gradients,
    images,
    names_of,
    random_cotangents,
    relative,
    true_gradients,
    true_images,
)
from tests.raster.scenes import HARD_CASES, few, gaussians, textured
from texgs.raster.api import rasterize
from texgs.raster.types import DEFAULT_OPTIONS, Options

# Needles are 10 000 times as long as wide: the intersection across them keeps a few digits in float32.
TOLERANCE = {"needles": 5e-3}
GRADIENT_TOLERANCE = {"needles": 2e-2}
# Seen exactly from the side a surfel faces neither way: the sign of its normal is a matter of rounding.
AMBIGUOUS = {"edge-on": {"normal"}}


def check_images(scene, device, name, options=DEFAULT_OPTIONS):
    """Compare all images of a scene, where the definition is sure of them."""
    rendered = images(scene.to(device).render(rasterize, scene.outputs, options))
    expected, sure = true_images(scene, scene.outputs, options), decided(scene, options)
    for image in names_of(scene):
        assert rendered[image].isfinite().all()
        if image not in AMBIGUOUS.get(name, ()):
            error = (rendered[image].cpu() - expected[image]).abs()[sure]
            assert float(error.max()) < TOLERANCE.get(name, 1e-4), image
    assert rendered["alpha"].max() <= 1


def check_gradients(scene, device, name, compared, options=DEFAULT_OPTIONS):
    """Compare the gradients of random combinations of some images."""
    cotangents = random_cotangents(scene, sorted(compared), decided(scene, options))
    derivatives = gradients(rasterize, scene.to(device), cotangents, options)
    for tensor, gradient in true_gradients(scene, cotangents, options).items():
        assert derivatives[tensor].isfinite().all()
        if gradient.norm() > 1e-6:
            assert relative(derivatives[tensor], gradient) < GRADIENT_TOLERANCE.get(name, 1e-3), tensor
        else:
            assert derivatives[tensor].norm() < 1e-3


@pytest.mark.parametrize("name", HARD_CASES)
def test_images(device, drawn, name):
    scene = drawn(HARD_CASES[name]())
    assert decided(scene).double().mean() > 0.85
    check_images(scene, device, name)


@pytest.mark.parametrize("name", HARD_CASES)
def test_gradients(device, drawn, name):
    scene = drawn(HARD_CASES[name]())
    scene = replace(scene, shift=torch.zeros(len(scene.means), 2))
    check_gradients(scene, device, name, set(names_of(scene)) - {"distortion"} - AMBIGUOUS.get(name, set()))


@pytest.mark.parametrize("name", HARD_CASES)
def test_textured(device, name):
    scene = HARD_CASES[name]()
    scene = textured(scene, sizes=[(4, 4), (1, 1), (33, 7), (1, 200), (60, 50)])
    rendered = images(scene.to(device).render(rasterize))
    expected = true_images(scene)
    error = (rendered["color"].cpu() - expected["color"]).abs()[decided(scene)]
    assert rendered["color"].isfinite().all()
    share = 0.98 if name == "edge-on" else 0.999  # along an edge texture coordinates run through all values
    assert (error < TOLERANCE.get(name, 1e-3)).double().mean() > share or not error.numel()
    for gradient in gradients(rasterize, scene.to(device), random_cotangents(scene, ("color",))).values():
        assert gradient.isfinite().all()


@pytest.mark.parametrize("name", ["crossing the camera plane", "edge-on", "smaller than a pixel", "needles"])
@pytest.mark.parametrize(
    "options", [Options(low_pass=1e30), Options(low_pass=64, filter_sigma=3)], ids=["off", "64"]
)
def test_other_filters(device, name, options):
    check_images(HARD_CASES[name](), device, name, options)


@pytest.mark.parametrize(
    "name", ["far off the image", "smaller than a pixel", "larger than the image", "needles"]
)
def test_antialiased(device, name):
    scene, options = gaussians(HARD_CASES[name]()), Options(antialiased=True)
    check_images(scene, device, name, options)
    check_gradients(scene, device, name, ("color", "depth"), options)


def test_every_surfel_at_one_pixel(device, drawn):
    scene = drawn(few(n=3000, width=20, height=20))
    scene = replace(scene, means=1e-3 * scene.means, opacities=0.01 * scene.opacities)
    rendered = images(scene.to(device).render(rasterize, scene.outputs))
    expected = true_images(scene, scene.outputs)
    error = (rendered["color"].cpu() - expected["color"]).abs()
    assert float(error.median()) < 1e-4  # depths differ by less than float32 resolves, so a few change places
    assert float(error.max()) < 0.05
