import numpy as np
import pytest
import torch
from torch.nn.functional import unfold

from tests.refusals import refused
from texgs.core.errors import ShapeError
from texgs.edit.sliced_wasserstein import (
    FeatureDistribution,
    PatchStatistics,
    at_quantiles,
    patches,
)


def noise(seed, *shape):
    return torch.rand(*shape, generator=torch.Generator().manual_seed(seed))


def maps(seed, *shape):
    return torch.randn(*shape, generator=torch.Generator().manual_seed(seed))


def test_patches_are_those_of_unfolding():
    image = noise(0, 3, 12, 15)
    corners = torch.tensor([[0, 0], [5, 8], [3, 2]])
    columns = unfold(image[None], 7)[0].T.reshape(6, 9, -1)
    torch.testing.assert_close(patches(image, corners), columns[corners[:, 0], corners[:, 1]])


@pytest.mark.parametrize(("n", "count"), [(50, 50), (50, 7), (7, 50), (1, 4)])
def test_quantiles_are_numpys(n, count):
    values = noise(1, 4, n).sort(dim=1).values
    expected = np.quantile(values.numpy(), (np.arange(count) + 0.5) / count, axis=1, method="hazen").T
    np.testing.assert_allclose(at_quantiles(values, count).numpy(), expected, atol=1e-6)


def test_a_uniform_shift_of_colour_is_found_exactly():
    """The projection of a shift by d is d times the sum of a filter; the mean square is over the bank."""
    picture = noise(7, 3, 50, 50)
    style = PatchStatistics.of(picture, seed=3)
    expected = (0.1 * style.filters[2].sum(dim=1)).square().mean()
    assert float(style.distance(picture + 0.1, bank=2)) == pytest.approx(float(expected), rel=0.05)


def test_only_patches_that_count_are_compared():
    picture = noise(8, 3, 64, 96)
    style = PatchStatistics.of(picture[:, :, :48])
    image = picture.clone()
    image[:, :, 52:] = 0
    where = torch.zeros(64, 96)
    where[4:60, 4:44] = 1
    assert float(style.distance(image, where)) < 0.01 < float(style.distance(image))
    nothing = style.distance(image.requires_grad_(), torch.zeros(64, 96))
    nothing.backward()
    assert float(nothing.detach()) == 0


def test_a_region_of_the_style_alone_counts():
    picture = noise(9, 3, 64, 64)
    picture[:, :, 40:] = 1
    region = torch.zeros(64, 64, dtype=torch.bool)
    region[:, :36] = True
    style = PatchStatistics.of(picture, region)
    assert float(style.distance(picture[:, :, :38])) < 0.02 < float(style.distance(picture))


def test_small_pictures_have_fewer_levels():
    assert len(PatchStatistics.of(noise(10, 3, 20, 20)).quantiles) == 2
    style = PatchStatistics.of(noise(12, 3, 40, 40))
    assert float(style.distance(noise(11, 3, 5, 5))) == 0
    wrong = torch.ones(9, 8)
    refused(lambda: style.distance(noise(13, 3, 9, 9), wrong), r"where: expected \[9, 9\]", ShapeError)


def test_of_features_it_is_the_distance_of_sorted_projections_and_so_is_its_gradient():
    style, features = maps(0, 5, 32, 64), maps(1, 5, 32, 64).requires_grad_()  # 2,048 = QUANTILES positions
    distribution = FeatureDistribution.of(style)
    distance = distribution.distance(features, bank=14)  # banks repeat after twelve
    directions, rows = distribution.directions.double(), [x.double().flatten(1) for x in (features, style)]
    ours, others = ((directions[2] @ x).sort(1).values for x in rows)
    expected = (ours - others).square().mean() / (directions.flatten(0, 1) @ rows[1]).var(1).mean()
    torch.testing.assert_close(distance.double(), expected, rtol=1e-4, atol=0)
    found, wanted = (torch.autograd.grad(x, features)[0] for x in (distance, expected))
    assert (found - wanted).norm() < 0.01 * wanted.norm()  # two that float32 cannot tell apart change places


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


def test_only_features_that_count_are_compared():
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


@pytest.mark.parametrize(
    ("features", "where", "message"),
    [
        (maps(6, 4, 8, 8), None, r"features: expected \[3, h, w\]"),
        (maps(7, 3, 8, 8), torch.ones(8, 9) > 0, r"where: expected \[8, 8\]"),
    ],
)
def test_shapes_that_do_not_fit_are_named(features, where, message):
    distribution = FeatureDistribution.of(maps(5, 3, 8, 8))
    refused(lambda: distribution.distance(features, where), message, ShapeError)
