"""Sharpness of images with known gradients."""

import math

import pytest
import torch

from texgs.core.errors import ShapeError
from texgs.metrics.sharpness import sharpness

EVERYWHERE = torch.ones(20, 30)


def ramp(across, down):
    y, x = torch.meshgrid(torch.arange(20.0), torch.arange(30.0), indexing="ij")
    return (across * x + down * y)[..., None].expand(-1, -1, 3)


def test_a_ramp_has_its_slope():
    assert sharpness(ramp(0.03, 0.04), EVERYWHERE) == pytest.approx(0.05, rel=1e-4)


def test_stripes_have_more_than_what_is_left_of_them_when_blurred():
    stripes = (torch.arange(30) % 4 < 2).float()[None, :, None].expand(20, -1, 3)
    blurred = (stripes[:, 2:] + 2 * stripes[:, 1:-1] + stripes[:, :-2]) / 4
    assert sharpness(stripes, EVERYWHERE) > 1.8 * sharpness(blurred, EVERYWHERE[:, :28])


def test_only_the_object_counts():
    image, alpha = ramp(0.01, 0.0).clone(), EVERYWHERE.clone()
    image[:, 15:] = torch.rand(20, 15, 3)
    alpha[:, 14:] = 0.2
    assert sharpness(image, alpha) == pytest.approx(0.01, rel=1e-4)
    assert math.isnan(sharpness(image, torch.zeros(20, 30)))
    with pytest.raises(ShapeError, match="alpha: expected"):
        sharpness(image, alpha[:5])
