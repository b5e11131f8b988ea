from statistics import fmean
from types import SimpleNamespace

import pytest
import torch
from torch.nn.functional import cosine_similarity

from tests.edit.scenes import ball, views
from tests.models.networks import vgg  # noqa: F401  a fixture
from texgs.fields.surfels.composition import Composition
from texgs.metrics.edits.style import Distances
from texgs.metrics.metric import Style
from texgs.metrics.style import StyleTarget, gram, on_object


def rows(vgg, image, share=None):  # noqa: F811
    """The features [n, C] of an image [3, h, w], or of what has a share [h, w] of it."""
    layers = [layer[0] for layer in vgg.layers(image[None])]
    return on_object(layers, torch.ones(image.shape[1:]) if share is None else share.float())


def distances(model, cameras, lights, style, vgg, region=None):  # noqa: F811
    """NNFM and Gram distance of views of a model to a style [3, h, w], means over views."""
    target, scene, found = StyleTarget.of(rows(vgg, style, region)), Composition([model]), []
    for camera, light in zip(cameras, lights, strict=True):
        shown = scene.render(camera, light)
        found.append(target.distances(rows(vgg, shown.color.clamp(0, 1).permute(2, 0, 1), shown.alpha)))
    return map(fmean, zip(*found, strict=True))


def test_gram_matrices_are_mean_products():
    features = torch.randn(5, 3, 4, generator=torch.Generator().manual_seed(0))
    expected = torch.zeros(5, 5, dtype=torch.float64)
    for column in features.double().flatten(1).T:
        expected += column[:, None] * column / 12
    torch.testing.assert_close(gram(features).double(), expected, rtol=1e-5, atol=1e-6)


def test_a_view_is_like_itself_and_less_like_noise(vgg):  # noqa: F811
    cameras, lights = views(1)
    shown = Composition([ball()]).render(cameras[0], lights[0]).color.permute(2, 0, 1)
    nnfm, alike = distances(ball(), cameras, lights, shown, vgg)
    assert nnfm < 1e-5
    noise = torch.rand(3, 64, 64, generator=torch.Generator().manual_seed(1))
    of_noise, unlike = distances(ball(), cameras, lights, noise, vgg)
    assert of_noise > nnfm + 0.01
    assert unlike > alike


def test_a_region_that_is_the_object_has_its_gram_matrix(vgg):  # noqa: F811
    cameras, lights = views(1)
    shown = Composition([ball()]).render(cameras[0], lights[0])
    given = ball(), cameras, lights, shown.color.permute(2, 0, 1), vgg
    (_, inside), (_, around) = (distances(*given, where) for where in (shown.alpha > 0.9, shown.alpha < 0.1))
    assert inside < 0.3 < around


def test_distances_are_those_of_all_features_on_the_object_by_exact_search():
    generator = torch.Generator().manual_seed(2)
    maps, picture = (torch.rand(6, *size, generator=generator) for size in ((5, 4), (3, 7)))
    alpha = torch.zeros(20, 16)
    alpha[4:12, 4:16] = 1  # two rows of three positions, of four pixels each way
    seen, style = maps[:, 1:3, 1:4].flatten(1).T.double(), picture.flatten(1).T.double()
    nearest = (1 - cosine_similarity(seen[:, None], style[None], dim=2)).min(1).values
    grams = [rows.T @ rows / len(rows) for rows in (seen, style)]
    picked = on_object([maps[:4], maps[4:]], alpha)
    torch.testing.assert_close(picked.double(), seen)
    target = StyleTarget.of(picture.flatten(1).T)
    nnfm, relative = target.distances(picked)
    assert nnfm == pytest.approx(float(nearest.mean()), abs=1e-6)
    assert relative == pytest.approx(float((grams[0] - grams[1]).norm() / grams[1].norm()), rel=1e-5)
    drawn, same = target.distances(picked, most=2, seed=5)
    assert any(drawn == pytest.approx(float(nearest[list(two)].mean()), abs=1e-6) for two in pairs(6))
    assert same == relative
    assert on_object([maps], 0 * alpha).shape == (0, 6)


def pairs(count):
    """All pairs of different numbers below a count."""
    return [(a, b) for a in range(count) for b in range(a)]


def test_a_picture_of_thin_lines_is_compared_as_a_whole(vgg):  # noqa: F811
    measured = SimpleNamespace(vgg=vgg, styles=[], shown=SimpleNamespace(device="cpu"))
    image, region = torch.rand(3, 64, 64), torch.zeros(64, 64, dtype=torch.bool)
    region[::16] = True
    whole = StyleTarget.of(Distances(measured).features(image, torch.ones(64, 64)))
    thin = Distances(measured).target(Style(None, image, region))
    assert torch.equal(thin.gram, whole.gram)
