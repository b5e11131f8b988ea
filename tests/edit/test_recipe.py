import pytest

from texgs.core.errors import ArgumentError
from texgs.edit.recipe import PRESETS, Recipe, preset


def test_presets_say_what_they_need():
    needs = {name: (recipe.needs_vgg, recipe.needs_clip) for name, recipe in PRESETS.items()}
    assert needs["default"] == (True, False)
    assert needs["patches"] == needs["preview"] == (False, False)
    assert needs["paper"] == (True, True)
    assert preset("paper", lambda_s=0.0).needs_vgg is False


def test_features_see_a_reduced_image_of_a_large_view():
    assert [Recipe().reduction(size, size // 2) for size in (64, 400, 512, 800, 1600)] == [1, 1, 1, 2, 3]
    assert Recipe(reduce=1).reduction(1600, 900) == 1


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"iterations": -1}, "iterations: expected 0 or more, got -1"),
        ({"rate": float("nan")}, "rate: expected 0 or more, got nan"),
        ({"features": 0, "patches": 0}, "features, patches: expected a weight above 0 for one of them"),
        ({"lambda_s": 1.5}, "lambda_s: expected a share from 0 to 1, got 1.5"),
        ({"pattern": 0}, "pattern: expected more than 0, got 0"),
        ({"chroma": 0}, "chroma: expected more than 0, got 0"),
        ({"distribution": -1}, "distribution: expected 0 or more, got -1"),
        ({"positions": 0}, "positions: expected more than 0, got 0"),
        ({"start": "noise"}, "start: expected one of projected, mean, random, transfer, got 'noise'"),
        ({"behind": "black"}, "behind: expected one of style, white, got 'black'"),
        ({"speed": 2}, "recipe: expected one of iterations, .*, got 'speed'"),
    ],
)
def test_mistakes_are_named(changes, message):
    with pytest.raises(ArgumentError, match=message):
        preset("default", **changes)


def test_a_recipe_that_is_unknown_is_answered_with_those_known():
    with pytest.raises(ArgumentError, match=r"expected one of default, .*paper, got 'fast'"):
        preset("fast")


def test_recipes_but_for_the_papers_follow_the_alpha_of_a_scene():
    recipe = preset("default")
    assert recipe.adapted(0.8) is recipe
    other = recipe.adapted(0.5)
    assert (other.opacity, other.chroma) == (8, 2)
    assert (other.distribution, other.patches) == (8 * recipe.distribution, 0)
    weightless = preset("patches")
    assert weightless.adapted(0.5).patches == weightless.patches
    assert preset("paper").adapted(0.5) == preset("paper")
