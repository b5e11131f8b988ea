"""Statistics of surfels, and the adjoint of rendering, against the definition."""

from dataclasses import replace

import pytest
import torch

from tests.raster.agreement import decided
from tests.raster.scenes import HARD_CASES, random_scene
from texgs.raster import reference
from texgs.raster.api import rasterize, splat
from texgs.raster.types import Options


@pytest.mark.parametrize("seed", [0, 1])
def test_statistics(device, drawn, seed):
    scene = drawn(random_scene(seed, n=300))
    expected = scene.double().render(reference.rasterize, ("statistics",)).statistics
    result = scene.to(device).render(rasterize, ("statistics",)).statistics
    unsure = int((~decided(scene)).sum())
    # a pixel on a threshold gives or takes a fragment of 1/255, or what is left of the light at its end
    torch.testing.assert_close(result.weight_sum.cpu().double(), expected.weight_sum, rtol=1e-4, atol=0.02)
    torch.testing.assert_close(result.weight_max.cpu().double(), expected.weight_max, rtol=1e-3, atol=5e-3)
    assert (result.pixels.cpu() - expected.pixels).abs().max() <= min(unsure, 10)
    seen = expected.pixels > 0
    assert (result.radii.cpu()[seen & (result.pixels.cpu() > 0)] > 0).all()
    torch.testing.assert_close(result.radii.cpu().double()[seen], expected.radii[seen], rtol=1e-3, atol=0.5)


@pytest.mark.parametrize("name", HARD_CASES)
def test_statistics_of_hard_cases(device, drawn, name):
    scene = drawn(HARD_CASES[name]())
    render = scene.to(device).render(rasterize, ("statistics",))
    result = render.statistics
    for tensor in vars(result).values():
        assert tensor.shape == (len(scene.means),)
        assert tensor.isfinite().all()
        assert (tensor >= 0).all()
    torch.testing.assert_close(result.weight_sum.sum(), render.alpha.sum(), rtol=1e-4, atol=1e-4)
    assert (result.radii[result.pixels > 0] > 0).all()
    assert (result.weight_max <= result.weight_sum + 1e-6).all()
    assert (result.weight_sum <= result.weight_max * result.pixels * (1 + 1e-5) + 1e-6).all()


@pytest.mark.parametrize("channels", [1, 3, 8, 32])
def test_splat_sums_the_image_by_weight(device, drawn, channels):
    scene = drawn(random_scene(2, n=250))
    image = torch.randn(scene.height, scene.width, channels, generator=torch.Generator().manual_seed(0))
    image = image * decided(scene)[..., None]
    expected, weights = reference.splat(image.double(), **scene.double().geometry())
    sums, total = splat(image.to(device), **scene.to(device).geometry())
    assert sums.shape == (250, channels)
    torch.testing.assert_close(sums.cpu().double(), expected, rtol=1e-4, atol=1e-4)
    torch.testing.assert_close(total.cpu().double(), weights, rtol=1e-4, atol=0.02)


def test_splat_is_the_adjoint_of_rendering(device, drawn):
    scene = drawn(replace(random_scene(3), background=None)).to(device)
    options = Options(low_pass=6.0, filter_sigma=1.0, dilation=0.5, antialiased=True)
    image = torch.randn(scene.height, scene.width, 3, generator=torch.Generator().manual_seed(0)).to(device)
    rendered = scene.render(rasterize, options=options).color
    sums, _ = splat(image, **scene.geometry(), options=options)
    forward, backward = (rendered.double() * image).sum(), (sums.double() * scene.features).sum()
    assert float(forward) == pytest.approx(float(backward), rel=1e-5)
