import math

import pytest
import torch

from texgs.core.errors import ShapeError
from texgs.edit.distribution import FeatureDistribution
from texgs.models.nnfm import drawn


def maps(seed, *shape):
    return torch.randn(*shape, generator=torch.Generator().manual_seed(seed))


def test_it_is_the_distance_of_sorted_projections_and_so_is_its_gradient():
    style, features = maps(0, 5, 32, 64), maps(1, 5, 32, 64).requires_grad_()  # 2,048 = QUANTILES positions
    distribution = FeatureDistribution.of(style)
    distance = distribution.distance(features, bank=14)  # banks repeat after twelve
    directions, rows = distribution.directions.double(), [x.double().flatten(1) for x in (features, style)]
    ours, others = ((directions[2] @ x).sort(1).values for x in rows)
    expected = (ours - others).square().mean() / (directions.flatten(0, 1) @ rows[1]).var(1).mean()
    torch.testing.assert_close(distance.double(), expected, rtol=1e-4, atol=0)
    gradients = [torch.autograd.grad(x, features)[0] for x in (distance, expected)]
    scale = float(gradients[1].abs().max())  # values that float32 cannot tell apart change places
    torch.testing.assert_close(*gradients, rtol=0, atol=1e-3 * scale)


def test_a_style_is_at_no_distance_and_a_constant_of_its_mean_at_one():
    style = maps(2, 6, 32, 64) + 3
    distribution = FeatureDistribution.of(style)
    assert float(distribution.distance(style)) < 1e-6
    mean = style.mean(dim=(1, 2), keepdim=True).expand_as(style)
    mean_of_banks = torch.stack([distribution.distance(mean, bank=bank) for bank in range(12)]).mean()
    assert float(mean_of_banks) == pytest.approx(1, rel=1e-3)


def test_a_mode_that_is_left_out_costs_though_each_feature_has_a_neighbour():
    """What NNFM cannot see: all features of the image are the style's, but only half of its kinds."""
    style = torch.zeros(4, 16, 16)
    style[0, :, :8] = style[1, :, 8:] = 1
    distribution = FeatureDistribution.of(style)
    assert float(distribution.distance(style[:, :, :8])) > 0.5 > 100 * float(distribution.distance(style))


def test_only_what_counts_is_compared():
    style = maps(3, 3, 16, 16)
    region = torch.zeros(16, 16, dtype=torch.bool)
    region[:, :8] = True
    masked, same = FeatureDistribution.of(style, region), FeatureDistribution.of(style[:, :, :8])
    torch.testing.assert_close(masked.quantiles, same.quantiles)
    image = torch.cat([style[:, :, :8], maps(4, 3, 16, 8) + 9], dim=2)
    assert float(masked.distance(image, region)) < 1e-4 < 1 < float(masked.distance(image))  # 128 quantiles
    image.requires_grad_()
    nothing = masked.distance(image, torch.zeros_like(region))
    nothing.backward()
    assert float(nothing.detach()) == float(image.grad.abs().max()) == 0


def test_a_draw_has_no_feature_twice_and_follows_its_seed():
    features = torch.arange(60.0).view(1, 6, 10).expand(2, 6, 10)
    one, same, other = (
        drawn(features, None, 50, torch.Generator().manual_seed(seed))[:, 0] for seed in (0, 0, 1)
    )
    assert len(one.unique()) == 50
    assert torch.equal(one, same)
    assert not torch.equal(one, other)
    assert math.isclose(float(drawn(features, None, 60, torch.Generator())[:, 1].sum()), 59 * 60 / 2)


def test_shapes_that_do_not_fit_are_named():
    distribution = FeatureDistribution.of(maps(5, 3, 8, 8))
    with pytest.raises(ShapeError, match=r"features: expected \[3, h, w\]"):
        distribution.distance(maps(6, 4, 8, 8))
    with pytest.raises(ShapeError, match=r"where: expected \[8, 8\]"):
        distribution.distance(maps(7, 3, 8, 8), torch.ones(8, 9, dtype=torch.bool))
