import pytest
import torch

from tests.edit.scenes import ball, views
from texgs.edit.canvas import mean_alpha
from texgs.edit.recipe import preset


@pytest.mark.parametrize("opacity", [-3.0, 4.0])
def test_it_is_the_weighted_mean_of_alpha_of_whole_views(opacity):
    cameras, lights = views(4)
    model = ball(opacity=opacity)
    alphas = torch.stack(
        [model.render(camera, light).alpha for camera, light in zip(cameras, lights, strict=True)]
    ).double()
    expected = float(alphas.square().sum() / alphas.sum())
    assert mean_alpha(model, cameras) == pytest.approx(expected, rel=1e-5)


def test_nothing_to_see_is_not_translucent():
    assert mean_alpha(ball(opacity=-60.0), views(2)[0]) == 1


def test_recipes_follow_it_but_for_the_papers():
    recipe = preset("default")
    assert recipe.adapted(0.8) is recipe
    other = recipe.adapted(0.5)
    assert (other.opacity, other.chroma) == (8, 2)
    assert (other.distribution, other.patches) == (8 * recipe.distribution, 0)
    weightless = preset("patches")
    assert weightless.adapted(0.5).patches == weightless.patches
    assert preset("paper").adapted(0.5) == preset("paper")
