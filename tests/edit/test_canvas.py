from dataclasses import replace

import pytest
import torch

from tests.edit.scenes import ball, views
from texgs.edit.canvas import mean_alpha, paint, visible_range
from texgs.edit.recipe import Recipe
from texgs.fields.part_edit import PartEdit
from texgs.fields.surfels.composition import Composition
from texgs.fields.surfels.model import Surfels


@pytest.fixture
def scene():
    """A ball with random texels, beside the middle of the first view."""
    p = ball().parameters
    texels = torch.rand(p["texels"].shape, generator=torch.Generator().manual_seed(0))
    return Surfels({**p, "texels": texels, "means": p["means"] + torch.tensor([0.0, 0.1, 0.15])})


def pasted(color, full):
    """Places of a full view [H, W, 3] over black at which it shows these colours."""
    height, width = color.shape[1:]
    places = [
        (top, left)
        for top in range(full.shape[0] - height + 1)
        for left in range(full.shape[1] - width + 1)
        if torch.allclose(full[top : top + height, left : left + width], color.permute(1, 2, 0), atol=2e-5)
    ]
    return places


@pytest.mark.parametrize(("is_lit", "look"), [(True, "shaded"), (False, "unshaded")])
@pytest.mark.parametrize("opacity", [1.0, 0.3])
def test_a_part_is_what_the_scene_renders_there(scene, is_lit, look, opacity):
    cameras, lights = views()
    scene.parameters["opacities"].fill_(0.5)
    full = Composition([scene]).render(
        cameras[0], lights[0], [PartEdit(opacity=opacity)], look=look, background=torch.zeros(3)
    )
    recipe = Recipe(opacity=opacity, is_lit=is_lit)
    color, alpha, _ = paint(scene, scene.parameters["texels"], cameras[0], lights[0], recipe)
    assert alpha.numel() < full.alpha.numel()
    assert len(pasted(color, full.color)) == 1
    torch.testing.assert_close(alpha.sum(), full.alpha.sum())
    recipe = replace(recipe, cropped=False)
    whole, *_ = paint(scene, scene.parameters["texels"], cameras[0], lights[0], recipe)
    torch.testing.assert_close(whole.permute(1, 2, 0), full.color, atol=1e-5, rtol=0)


def test_the_share_of_chosen_surfels_and_of_the_others_make_up_alpha(scene):
    cameras, lights = views()
    chosen = scene.parameters["means"][:, 1] > 0.1
    shares = [
        paint(scene, scene.parameters["texels"], cameras[0], lights[0], Recipe(), mask)[2]
        for mask in (chosen, ~chosen)
    ]
    alpha = paint(scene, scene.parameters["texels"], cameras[0], lights[0], Recipe())[1]
    torch.testing.assert_close(shares[0] + shares[1], alpha, atol=1e-5, rtol=0)
    assert min(share.max() for share in shares) > 0.9


@pytest.mark.parametrize(
    ("size", "places", "expected"),
    [
        (60, range(20, 31), (16, 40)),  # in multiples of eight
        (30, [0], (0, 8)),
        (5, [2], (0, 5)),
        (5, [], (0, 5)),
    ],
)
def test_an_extent_holds_all_that_is_seen_and_stays_within_the_image(size, places, expected):
    seen = torch.zeros(size, dtype=torch.bool)
    seen[list(places)] = True
    span = visible_range(seen)
    assert (span.start, span.stop) == expected


@pytest.mark.parametrize("opacity", [-3.0, 4.0])
def test_the_mean_alpha_is_the_weighted_mean_of_alpha_of_whole_views(opacity):
    cameras, lights = views(4)
    model = ball(opacity=opacity)
    alphas = torch.stack(
        [model.render(camera, light).alpha for camera, light in zip(cameras, lights, strict=True)]
    ).double()
    expected = float(alphas.square().sum() / alphas.sum())
    assert mean_alpha(model, cameras) == pytest.approx(expected, rel=1e-5)
    assert mean_alpha(ball(opacity=-60.0), cameras) == 1, "nothing to see is not translucent"
