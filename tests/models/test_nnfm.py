import pytest
import torch
from torch.nn.functional import cosine_similarity

from tests.refusals import refused
from texgs.core.errors import ShapeError
from texgs.models.nnfm import StyleFeatures, nnfm


def made(seed, *shape):
    return torch.randn(*shape, generator=torch.Generator().manual_seed(seed))


def brute(features, style, where=None):
    """The definition, one position after the other, in float64."""
    queries, keys = features.double().flatten(1).T, style.double().flatten(1).T
    chosen = range(len(queries)) if where is None else where.flatten().nonzero()[:, 0].tolist()
    distances = []
    for index in chosen:
        distances.append(min(1 - float(cosine_similarity(queries[index], key, dim=0)) for key in keys))
    return sum(distances) / len(distances)


def test_the_loss_equals_a_search_by_brute_force():
    features, style = made(0, 12, 5, 6), made(1, 12, 7, 4)
    where = made(2, 5, 6) > 0
    library = StyleFeatures.of(style)
    assert float(nnfm(features, library)) == pytest.approx(brute(features, style), abs=1e-6)
    assert float(nnfm(features, library, where)) == pytest.approx(brute(features, style, where), abs=1e-6)


def test_neither_brightness_nor_the_place_of_a_feature_in_the_style_matters():
    features, style = made(4, 12, 5, 5), made(5, 12, 36)
    given, moved = (StyleFeatures.of(x.reshape(12, 6, 6)) for x in (style, style[:, torch.randperm(36)]))
    assert float(nnfm(2.5 * style.reshape(12, 6, 6), given)) < 1e-6
    assert float(nnfm(features, given)) == pytest.approx(float(nnfm(features, moved)), abs=1e-6)


def test_the_gradient_holds_neighbours_fixed():
    features, style = made(6, 6, 2, 3), made(7, 6, 4, 4)
    features = features.requires_grad_()
    (gradient,) = torch.autograd.grad(nnfm(features, StyleFeatures.of(style)), features)
    x, step = features.detach().double(), 1e-4
    for index in range(6):
        moved = [x.clone() for _ in range(2)]
        for sign, y in zip((1, -1), moved, strict=True):
            y[index, 1, 2] += sign * step
        numeric = (brute(moved[0], style) - brute(moved[1], style)) / (2 * step)
        assert float(gradient[index, 1, 2]) == pytest.approx(numeric, abs=1e-5)


def test_a_search_in_few_dimensions_finds_neighbours_that_are_as_near():
    """Features that vary in 10 directions of 64, with a little noise in all, as those of a network do."""
    mixing = made(8, 64, 10)
    features, style = (
        (mixing @ made(seed, 10, 900) + 0.1 * made(seed + 1, 64, 900)).reshape(64, 30, 30) for seed in (9, 11)
    )
    exact = float(nnfm(features, StyleFeatures.of(style)))
    assert exact <= float(nnfm(features, StyleFeatures.of(style, dimensions=12))) < exact * 1.05
    assert float(nnfm(features, StyleFeatures.of(style, dimensions=2))) > exact * 1.2


def test_only_the_region_counts_and_no_more_positions_than_asked_for():
    style = made(12, 12, 8, 8)
    region = torch.zeros(8, 8, dtype=torch.bool)
    region[2:5, 3:7] = True
    library = StyleFeatures.of(style, region)
    assert len(library.unit) == 12
    assert float(nnfm(style, library, region)) < 1e-6
    assert float(nnfm(style, library, ~region)) > 0.1
    few = StyleFeatures.of(style, positions=20, seed=1)
    assert len(few.unit) == len(few.unit.unique(dim=0)) == 20, "none twice"
    assert torch.equal(few.unit, StyleFeatures.of(style, positions=20, seed=1).unit)
    assert not torch.equal(few.unit, StyleFeatures.of(style, positions=20, seed=2).unit)


def test_some_of_the_positions_stand_for_all():
    features, library = made(13, 12, 40, 40), StyleFeatures.of(made(14, 12, 10, 10))
    whole = float(nnfm(features, library))
    assert float(nnfm(features, library, most=1600)) == pytest.approx(whole, abs=1e-6)
    parts = [float(nnfm(features, library, most=400, seed=seed)) for seed in range(2)]
    assert parts[0] != parts[1]
    assert parts == pytest.approx([whole] * 2, rel=0.05)


def test_no_position_is_no_loss_but_has_a_gradient():
    features = made(15, 12, 4, 4).requires_grad_()
    nothing = nnfm(features, StyleFeatures.of(made(16, 12, 4, 4)), torch.zeros(4, 4, dtype=torch.bool))
    nothing.backward()
    assert float(nothing.detach()) == 0
    assert not features.grad.any()


def test_mistakes_are_named():
    style = made(17, 12, 4, 4)
    none, wide = torch.zeros(4, 4, dtype=torch.bool), torch.ones(4, 5, dtype=torch.bool)
    refused(lambda: StyleFeatures.of(style, none), "region: ")
    refused(lambda: StyleFeatures.of(style, wide), "where: ", ShapeError)
    refused(lambda: nnfm(made(18, 11, 4, 4), StyleFeatures.of(style)), "features: ", ShapeError)
