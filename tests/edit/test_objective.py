import pytest
import torch

from tests.refusals import refused
from texgs.core import memory
from texgs.core.errors import OutOfMemoryError
from texgs.edit.objective import Objective, object_features
from texgs.edit.recipe import Recipe, preset
from texgs.edit.sliced_wasserstein import FeatureDistribution, PatchStatistics
from texgs.edit.style_picture import StylePicture
from texgs.models.nnfm import StyleFeatures, nnfm
from texgs.models.pictures import picture

STYLE = StylePicture.of(picture("weave", 64))
EXACT = {"positions": None, "dimensions": None, "queries": None}


def test_terms_are_the_losses_times_their_weights(vgg):
    image, share = torch.rand(3, 48, 40), torch.rand(48, 40).round()
    recipe = preset("default", features=2.0, lambda_s=0.75, distribution=0.5, patches=3.0, **EXACT)
    terms = Objective.of(recipe, STYLE, 1, vgg, lambda x: x[0, 0, 0]).terms(image, share, 5)
    where = object_features(share, 4, torch.Size((12, 10)))
    exact = nnfm(vgg.features(image), StyleFeatures.of(vgg.features(STYLE.image)), where)
    assert float(terms["nnfm"]) == pytest.approx(2 * 0.75 * float(exact), rel=1e-5)
    layers = ("relu1_2", "relu2_2")
    ours, others = ([x[0] for x in vgg.layers(each[None], layers)] for each in (image, STYLE.image))
    ours.append(vgg.features(image))
    others.append(vgg.features(STYLE.image))
    distances = [
        FeatureDistribution.of(other).distance(
            our, object_features(share, 48 // our.shape[1], our.shape[1:]), 5, 5
        )
        for our, other in zip(ours, others, strict=True)
    ]
    mean = sum(map(float, distances)) / 3
    assert float(terms["distribution"]) == pytest.approx(2 * 0.75 * 0.5 * mean, rel=1e-5)
    assert float(terms["clip"]) == pytest.approx(2 * 0.25 * float(image[0, 0, 0]))
    distance = PatchStatistics.of(STYLE.image).distance(image, share, bank=5, seed=5)
    assert float(terms["patches"]) == pytest.approx(3 * float(distance), rel=1e-5)


def test_features_larger_than_memory_are_refused(vgg, monkeypatch):
    monkeypatch.setattr(memory, "free_memory", lambda: 2**20)
    of_style = lambda: Objective.of(preset("default"), STYLE.scaled(300), 1, vgg, None)  # noqa: E731
    refused(of_style, "features of a style of 300 x 300 pixels", OutOfMemoryError)


@pytest.mark.parametrize(("height", "width", "reduce"), [(3, 40, 1), (48, 1, 1), (8, 8, 3)])
def test_a_part_too_small_for_features_has_no_distance(vgg, height, width, reduce):
    """A view may show a sliver of the model alone, or nothing of it."""
    objective = Objective.of(preset("default", patches=0.0), STYLE, reduce, vgg, None)
    image = torch.rand(3, height, width).requires_grad_()
    terms = objective.terms(image, torch.ones(height, width), 0)
    assert {name: float(value.detach()) for name, value in terms.items()} == {"nnfm": 0, "distribution": 0}
    sum(terms.values()).backward()
    assert not image.grad.any()


def test_at_lower_resolution_image_and_style_are_both_reduced(vgg):
    recipe = preset("default", patches=0.0, **EXACT)
    small = STYLE.scaled(32)
    half = Objective.of(recipe, STYLE, 2, vgg, None)
    assert len(half.style.unit) == 64
    image = small.image.repeat_interleave(2, 1).repeat_interleave(2, 2)
    assert float(half.terms(image, torch.ones(64, 64), 0)["nnfm"]) < 1e-5


def test_only_the_region_of_the_style_is_searched(vgg):
    region = torch.zeros(64, 64, dtype=torch.bool)
    region[:32] = True
    style = StylePicture(STYLE.image, region)
    objective = Objective.of(preset("default", patches=0.0, **EXACT), style, 1, vgg, None)
    assert len(objective.style.unit) == 16 * 8


def test_what_is_not_on_the_object_does_not_count(vgg):
    image, share = torch.rand(3, 48, 48), torch.zeros(48, 48)
    share[:, :24] = 1
    for name in ("default", "paper"):
        recipe = preset(name, patches=20.0, lambda_s=1.0)
        x = image.clone().requires_grad_()
        terms = Objective.of(recipe, STYLE, 1, vgg, None).terms(x, share, 0)
        (gradient,) = torch.autograd.grad(sum(terms.values()), x)
        far = gradient[:, :, 46:].abs().max()  # farther than a filter or a patch reaches from the object
        assert bool(far > 1e-7 * gradient.abs().max()) == (name == "paper")  # below: rounding of convolutions


def test_features_see_a_reduced_image_of_a_large_view():
    assert [Recipe().reduction(size, size // 2) for size in (64, 400, 512, 800, 1600)] == [1, 1, 1, 2, 3]
    assert Recipe(reduce=1).reduction(1600, 900) == 1


def test_recipes_but_for_the_papers_follow_the_alpha_of_a_scene():
    recipe = preset("default")
    assert recipe.adapted(0.8) is recipe
    other = recipe.adapted(0.5)
    assert (other.opacity, other.chroma) == (8, 2)
    assert (other.distribution, other.patches) == (8 * recipe.distribution, 0)
    weightless = preset("patches")
    assert weightless.adapted(0.5).patches == weightless.patches
    assert preset("paper").adapted(0.5) == preset("paper")
