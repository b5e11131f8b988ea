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


def test_recipes_but_for_the_papers_follow_the_alpha_of_a_scene():
    recipe = preset("default")
    assert recipe.adapted(0.8) is recipe
    other = recipe.adapted(0.5)
    assert (other.opacity, other.chroma) == (8, 2)
    assert (other.distribution, other.patches) == (8 * recipe.distribution, 0)
    weightless = preset("patches")
    assert weightless.adapted(0.5).patches == weightless.patches
    assert preset("paper").adapted(0.5) == preset("paper")
