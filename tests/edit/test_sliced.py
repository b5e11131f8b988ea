import numpy as np
import pytest
import torch
from scipy.stats import wasserstein_distance
from torch.nn.functional import unfold

from texgs.core.errors import ShapeError
from texgs.edit.sliced import PatchStatistics, at_quantiles, patches, sliced_wasserstein, to_quantiles


def noise(seed, *shape):
    return torch.rand(*shape, generator=torch.Generator().manual_seed(seed))


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


def test_in_one_dimension_it_is_the_wasserstein_distance():
    """Of a sample and the same moved aside, the mean distance is how far: its square is the result."""
    values = noise(2, 3, 200)
    moved = values[:, torch.randperm(200)] + 0.25
    result = float(to_quantiles(moved, at_quantiles(values.sort(dim=1).values, 200)))
    distance = wasserstein_distance(values[0].numpy(), moved[0].numpy())
    assert result == pytest.approx(distance**2, abs=1e-5)


def test_the_gradient_is_that_of_sorting():
    values, quantiles = noise(3, 2, 40).double(), noise(4, 2, 40).double().sort(dim=1).values
    one, other = (values.clone().requires_grad_() for _ in range(2))
    to_quantiles(one, quantiles).backward()
    (other.sort(dim=1).values - quantiles).square().mean().backward()
    torch.testing.assert_close(one.grad, other.grad)


def test_a_picture_is_at_no_distance_from_itself_and_some_from_a_smooth_one():
    picture = noise(5, 3, 60, 60)
    style = PatchStatistics.of(picture)
    assert float(sliced_wasserstein(picture, style)) < 1e-5
    smooth = torch.nn.functional.avg_pool2d(noise(6, 1, 3, 62, 62), 3, 1)[0]
    assert float(sliced_wasserstein(smooth, style)) > 0.01


def test_a_uniform_shift_of_colour_is_found_exactly():
    """The projection of a shift by d is d times the sum of a filter; the mean square is over the bank."""
    picture = noise(7, 3, 50, 50)
    style = PatchStatistics.of(picture, seed=3)
    expected = (0.1 * style.filters[2].sum(dim=1)).square().mean()
    distance = sliced_wasserstein(picture + 0.1, style, bank=2)
    assert float(distance) == pytest.approx(float(expected), rel=0.05)


def test_only_what_counts_is_compared():
    picture = noise(8, 3, 64, 96)
    style = PatchStatistics.of(picture[:, :, :48])
    image = picture.clone()
    image[:, :, 52:] = 0
    where = torch.zeros(64, 96)
    where[4:60, 4:44] = 1
    assert float(sliced_wasserstein(image, style, where)) < 0.01 < float(sliced_wasserstein(image, style))
    nothing = sliced_wasserstein(image.requires_grad_(), style, torch.zeros(64, 96))
    nothing.backward()
    assert float(nothing.detach()) == 0


def test_a_region_of_the_style_alone_counts():
    picture = noise(9, 3, 64, 64)
    picture[:, :, 40:] = 1
    region = torch.zeros(64, 64, dtype=torch.bool)
    region[:, :36] = True
    style = PatchStatistics.of(picture, region)
    inside = picture[:, :, :38]
    assert float(sliced_wasserstein(inside, style)) < 0.02 < float(sliced_wasserstein(picture, style))


def test_small_pictures_have_fewer_levels():
    assert len(PatchStatistics.of(noise(10, 3, 20, 20)).quantiles) == 2
    assert float(sliced_wasserstein(noise(11, 3, 5, 5), PatchStatistics.of(noise(12, 3, 40, 40)))) == 0
    with pytest.raises(ShapeError, match=r"where: expected \[9, 9\]"):
        sliced_wasserstein(noise(13, 3, 9, 9), PatchStatistics.of(noise(14, 3, 40, 40)), torch.ones(9, 8))
