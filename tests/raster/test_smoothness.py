"""Bilateral smoothness of attribute maps against the definition."""

import math

import pytest
import torch

from tests.raster.agreement import evaluate
from tests.raster.threads import require_same_bits
from texgs.core.errors import ArgumentError, ShapeError
from texgs.raster.losses import bilateral_smoothness
from texgs.raster.reference import losses as definition

SIZES = [(1, 1, 1), (2, 3, 4), (33, 7, 1), (7, 33, 4), (150, 300, 2), (359, 641, 1)]


def maps(height, width, channels, device="cpu"):
    """Attribute, guide and alpha, planar in memory."""
    generator = torch.Generator().manual_seed(height * width)
    planes = torch.rand(channels + 4, height, width, generator=generator).to(device)
    return planes[:channels].permute(1, 2, 0), 0.3 * planes[channels:-1].permute(1, 2, 0), planes[-1]


@pytest.mark.parametrize("size", SIZES)
def test_value_and_gradient(size, device):
    attribute, guide, alpha = maps(*size, device)
    value, gradient = evaluate(bilateral_smoothness, attribute, guide, alpha)
    expected, expected_gradient = evaluate(
        definition.bilateral_smoothness, *(x.double() for x in (attribute, guide, alpha))
    )
    assert value.item() == pytest.approx(expected.item(), rel=1e-6)  # float32 sums
    assert (gradient - expected_gradient).norm() <= 2e-6 * expected_gradient.norm()  # float32, exp to 2e-7


def test_definition_by_finite_differences():
    attribute, guide, alpha = (x.double() for x in maps(5, 6, 2))
    assert torch.autograd.gradcheck(
        lambda a: definition.bilateral_smoothness(a, guide, alpha), attribute.requires_grad_()
    )


def test_a_step_of_the_attribute_by_hand(device):
    attribute, guide, alpha = (torch.zeros(9, 12), torch.full((9, 12, 3), 0.5), torch.zeros(9, 12))
    attribute[:, 6:] = 0.25
    alpha[3:6, 4:8] = 1  # away from the border; the step lies between columns 5 and 6
    value = bilateral_smoothness(attribute.to(device), guide.to(device), alpha.to(device))
    assert value.item() == pytest.approx(3 * 2 * 4 * 0.25 / (9 * 12), rel=1e-6)
    guide[:, 6:] = 0.75  # the same step in the guide
    value = bilateral_smoothness(attribute.to(device), guide.to(device), alpha.to(device))
    assert value.item() == pytest.approx(3 * 2 * 4 * 0.25 * math.exp(-4 * 0.25) / (9 * 12), rel=1e-6)


def test_channels_are_averaged(device):
    attribute, guide, alpha = maps(30, 40, 3, device)
    value, gradient = evaluate(bilateral_smoothness, attribute, guide, alpha)
    alone = [evaluate(bilateral_smoothness, attribute[..., c], guide, alpha) for c in range(3)]
    assert value.item() == pytest.approx(sum(v.item() for v, _ in alone) / 3, rel=1e-6)
    torch.testing.assert_close(gradient, torch.stack([g for _, g in alone], -1) / 3)


def test_a_constant_attribute_inside_costs_nothing(device):
    _, guide, alpha = maps(30, 40, 1, device)
    alpha[[0, -1]] = 0
    alpha[:, [0, -1]] = 0  # the zeros outside the image are an edge
    value, gradient = evaluate(bilateral_smoothness, torch.full_like(alpha, 0.7), guide, alpha)
    assert value.item() == 0
    assert not gradient.any()


def test_a_guide_that_is_not_finite_is_seen(device):
    guide = torch.full((8, 9, 3), float("nan"), device=device)
    attribute, alpha = torch.rand(8, 9, device=device), torch.ones(8, 9, device=device)
    assert bilateral_smoothness(attribute, guide, alpha).isnan()


def test_any_number_of_threads_gives_the_same_bits():
    require_same_bits(evaluate, bilateral_smoothness, *maps(359, 641, 2))


def test_errors_name_the_argument():
    attribute, guide, alpha = maps(4, 5, 2)
    with pytest.raises(ShapeError, match=r"guide: expected \[4, 5, 3\], got \[4, 5, 2\]"):
        bilateral_smoothness(attribute, attribute, alpha)
    with pytest.raises(ShapeError, match=r"alpha: expected \[4, 5\], got \[5, 4\]; did you transpose"):
        bilateral_smoothness(attribute, guide, alpha.T)
    with pytest.raises(ArgumentError, match="attribute: expected float32, got float64"):
        bilateral_smoothness(attribute.double(), guide, alpha)
    with pytest.raises(ArgumentError, match="guide: not differentiable here"):
        bilateral_smoothness(attribute, guide.requires_grad_(), alpha)
    with pytest.raises(ArgumentError, match="image: expected at least one pixel"):
        bilateral_smoothness(attribute[:0], guide.detach()[:0], alpha[:0])
