import math

import pytest
import torch

from texgs.metrics.image import psnr, ssim
from texgs.raster.reference.losses import ssim as reference_ssim


def test_psnr_of_a_constant_error():
    target = torch.full((4, 5, 3), 0.5)
    assert psnr(target + 0.1, target) == pytest.approx(20, abs=1e-4)
    assert psnr(target, target) == 100
    assert math.isnan(psnr(target * math.nan, target)), "not the best value"


def test_values_are_clamped_before_they_are_compared():
    target = torch.ones(3, 3, 3)
    assert psnr(target + 7, target) == 100
    assert psnr(torch.full_like(target, -3.0), target) == pytest.approx(0, abs=1e-6)


def test_psnr_is_over_all_pixels_and_channels():
    target = torch.zeros(10, 10, 3)
    image = target.clone()
    image[0, 0, 0] = 1
    assert psnr(image, target) == pytest.approx(10 * math.log10(300), abs=1e-4)


def test_ssim_is_the_reference():
    generator = torch.Generator().manual_seed(0)
    image, target = torch.rand(2, 20, 24, 3, generator=generator)
    expected = reference_ssim(image.double(), target.double())
    assert ssim(image, target) == pytest.approx(float(expected), abs=1e-5)
    assert ssim(target, target) == 1
