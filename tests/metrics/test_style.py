import math

import pytest
import torch

from tests.edit.scenes import ball, views
from tests.models.networks import vgg  # noqa: F401  a fixture
from texgs.fields.surfels.composition import Composition
from texgs.fields.surfels.model import Surfels
from texgs.metrics.style import gram, style_similarity


def test_gram_matrices_are_mean_products():
    features = torch.randn(5, 3, 4, generator=torch.Generator().manual_seed(0))
    expected = torch.zeros(5, 5, dtype=torch.float64)
    for column in features.double().flatten(1).T:
        expected += column[:, None] * column / 12
    torch.testing.assert_close(gram(features).double(), expected, rtol=1e-5, atol=1e-6)


def test_a_view_is_like_itself_and_less_like_noise(vgg):  # noqa: F811
    cameras, lights = views(1)
    shown = Composition([ball()]).render(cameras[0], lights[0]).color.permute(2, 0, 1)
    itself = style_similarity(ball(), cameras, lights, shown, vgg)
    assert itself.nnfm < 1e-5
    noise = torch.rand(3, 64, 64, generator=torch.Generator().manual_seed(1))
    other = style_similarity(ball(), cameras, lights, noise, vgg)
    assert other.nnfm > itself.nnfm + 0.01
    assert other.gram > itself.gram


def test_a_region_that_is_the_object_has_its_gram_matrix_and_colour(vgg):  # noqa: F811
    cameras, lights = views(1)
    shown = Composition([ball()]).render(cameras[0], lights[0])
    inside = style_similarity(ball(), cameras, lights, shown.color.permute(2, 0, 1), vgg, shown.alpha > 0.9)
    around = style_similarity(ball(), cameras, lights, shown.color.permute(2, 0, 1), vgg, shown.alpha < 0.1)
    assert inside.gram < 0.3 < around.gram
    assert max(abs(x) for x in inside.color) < 1e-5


def test_colours_are_those_of_opaque_pixels(vgg):  # noqa: F811
    cameras, lights = views(2)
    color = torch.tensor([0.1, 0.5, 0.9])
    p = ball().parameters
    plain = Surfels({**p, "palette": color, "colors": torch.zeros_like(p["colors"])})
    scores = style_similarity(plain, cameras, lights, torch.full((3, 64, 64), 0.5), vgg)
    pixels = []
    for camera, light in zip(cameras, lights, strict=True):
        shown = Composition([plain]).render(camera, light)
        pixels.append(shown.color.clamp(0, 1)[shown.alpha > 0.9])
    expected = (torch.cat(pixels).mean(0) - 0.5).tolist()
    assert list(scores.color) == pytest.approx(expected, abs=1e-5)


def test_nothing_to_see_is_no_number(vgg):  # noqa: F811
    cameras, lights = views(1)
    faint = ball(opacity=-9.0)
    scores = style_similarity(faint, cameras, lights, torch.rand(3, 64, 64), vgg)
    assert all(math.isnan(x) for x in (scores.nnfm, scores.gram, *scores.color))
