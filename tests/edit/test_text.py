"""Text-driven editing, offline: what it changes and leaves, which views it edits, and what it refuses."""

from dataclasses import replace
from functools import partial
from itertools import permutations

import pytest
import torch
from torch.testing import assert_close

from tests.edit.guidances import Identity, Returns, Tint
from tests.edit.scenes import around, shell
from tests.fields.surfels.samples import sample
from tests.raster.requirements import require_same_bits
from tests.refusals import refused
from texgs.core.camera import orbit
from texgs.core.errors import ArgumentError, ShapeError
from texgs.core.lens import Lens
from texgs.core.light import HEADLIGHT, Light
from texgs.edit.observations import observe, render_views
from texgs.edit.texel_solver import image_loss
from texgs.edit.text import RECIPES, TextRecipe, axis_cameras, edit_by_text, nearest_to_axes
from texgs.fields.surfels.composition import Composition
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.texels import (
    bare_colors,
    owners,
    reduce_constant_textures,
    spread_colors,
    with_colors,
    with_single_texels,
)
from texgs.models.filters import ProceduralFilters
from texgs.raster import Texture
from texgs.volume.cameras import icosphere

BLUE, RED = (0.2, 0.3, 0.8), (0.9, 0.1, 0.1)
QUICK = TextRecipe("all", opacities=(1.0, 0.5), sweeps=2)
ADAM = replace(QUICK, iterations=150, rate=0.05)
CHANGES = {"texels", "colors"}
TURNED = torch.diag(torch.tensor([-1.0, 1.0, -1.0, 1.0]))  # half a turn about the upright axis
AWAY = [replace(camera, viewmat=TURNED @ camera.viewmat) for camera in around(2)]


@pytest.fixture(scope="module")
def model():
    return shell()


def edited(model, guidance, recipe=QUICK, instruction="x", **options):
    """The model after an edit of six views from all sides."""
    return edit_by_text(model, around(6), guidance, instruction, recipe, **options).model


def seen(model, count=5):
    """Bare colours from other sides than those that were edited."""
    return render_views(model, around(count + 4)[2:-2], None)


def missed(views, color):
    """Mean difference to a colour where views are opaque."""
    return (views.images[views.alphas > 0.95] - torch.tensor(color)).abs().mean()


@pytest.mark.parametrize("recipe", [QUICK, ADAM], ids=["solve", "adam"])
def test_a_tint_is_seen_from_everywhere_and_the_rest_stays(model, recipe):
    done = edited(model, Tint(BLUE), recipe)
    for name, x in model.parameters.items():
        assert torch.equal(x, done.parameters[name]) == (name not in CHANGES), name
    assert done.metadata == model.metadata
    assert missed(seen(done), BLUE) < 0.01


@pytest.mark.parametrize("recipe", [QUICK, replace(ADAM, iterations=20)], ids=["solve", "adam"])
def test_threads_change_nothing(model, recipe):
    edit = partial(edited, model, ProceduralFilters(), recipe, "turn it into an oil painting")
    require_same_bits(lambda: edit().parameters, threads=(3,))


def test_light_falls_on_what_was_edited_bare(model):
    """Under any light the edited scene is shaded as a scene of that colour is."""
    done = edited(model, Tint(BLUE))
    plain = with_colors(model, torch.tensor(BLUE).expand(len(model.parameters["texels"]), 3))
    for light in (HEADLIGHT, Light("directional", 70, 20)):
        color, expected = (Composition([m]).render(around(3)[1], light).color for m in (done, plain))
        assert_close(color, expected, atol=0.03, rtol=0)


def test_lit_edits_look_as_wanted_under_the_light_of_the_edit(model):
    color = (0.4, 0.5, 0.3)
    lit, bare = (render_views(edited(model, Tint(color, lit=x)), around(6), HEADLIGHT) for x in (True, False))
    assert missed(lit, color) < 0.02
    assert missed(bare, color) > 0.04


def test_identity_changes_nothing_that_is_seen(model):
    done = edit_by_text(model, around(8), Identity(lit=False), "as it is", TextRecipe("all")).model
    assert (seen(model).images - seen(done).images).abs().mean() < 0.004


@pytest.mark.parametrize("is_textured", [True, False])
def test_only_chosen_surfels_change(model, is_textured):
    upper = model.parameters["means"][:, 1] > 0
    done = edited(model, Tint(BLUE), replace(QUICK, is_textured=is_textured), surfels=upper)
    place, surfel = owners(model.parameters)
    for name, kept in (("colors", ~upper), ("texels", place[~upper[surfel]])):
        assert torch.equal(model.parameters[name][kept], done.parameters[name][kept])
    assert (bare_colors(done)[place[upper[surfel]]] - torch.tensor(BLUE)).abs().mean() < 0.02


def test_highlights_keep_their_colour():
    """A dark edit of a bright model: where highlights saturate, they are white, not the old colour's rest."""
    bright = shell(opacity=6.0)
    p = {**bright.parameters, "specular": torch.tensor([3.0])}
    colors = torch.tensor([[1.0, 1.0, 0.1]]).expand(len(p["texels"]), 3)
    done = edited(with_colors(type(bright)(p, bright.shading), colors), Tint((0.1, 0.1, 0.1)))
    shown = Composition([done]).render(around(6)[3]).color[20:28, 20:28]
    assert shown.max() > 0.6
    assert (shown.amax(dim=-1) - shown.amin(dim=-1)).max() < 0.05


def test_refinement_sees_the_first_result(model):
    guidance = Tint(RED)
    second = edited(edited(model, Tint(BLUE)), guidance)
    (views,) = guidance.seen
    assert missed(views, BLUE) < 0.02
    assert torch.equal(views.images, views.conditions)
    assert missed(seen(second), RED) < 0.02


def test_same_seed_same_model(model):
    one, two, other = (
        edited(model, Tint(BLUE, sigma=0.2), seed=seed).parameters["texels"] for seed in (1, 1, 2)
    )
    assert torch.equal(one, two)
    assert not torch.equal(one, other)


def test_share_of_texels_seen(model):
    solid = TextRecipe("all", opacities=(2.0,), sweeps=1)
    front, every = (edit_by_text(model, around(n), Identity(), "x", solid).seen for n in (1, 10))
    assert 0.2 < front < 0.75
    assert every > 0.95


def test_unseen_sides_have_the_new_colour(model):
    back = seen(edit_by_text(model, around(1), Tint(BLUE), "x", QUICK).model)
    assert (back.images[back.alphas > 0.95] - torch.tensor(BLUE)).abs().max() < 0.1


def test_texels_that_no_view_shows_stay_as_they_are_in_the_papers_recipe(model):
    """Surfels bit for bit; of those that are cut by the border of the view the colour, even beyond white."""
    p = model.parameters
    model = Surfels({**p, "texels": p["texels"] + 0.5}, model.shading, model.metadata)
    recipe, camera = replace(RECIPES["paper"], views="all", iterations=20), around(1)[0].crop(0, 0, 20, 48)
    done, filled = (
        edit_by_text(model, [camera], Tint(BLUE), "x", replace(recipe, fills=fills)).model
        for fills in (False, True)
    )
    shown = sum(shares(model, camera, opacity) for opacity in recipe.opacities)
    place, surfel = owners(p)
    of_surfel = torch.zeros(len(model)).index_add_(0, surfel, shown[place])
    hidden = of_surfel == 0
    for name, whole in (("colors", hidden), ("texels", torch.empty_like(shown > 0))):
        if name == "texels":
            whole[place] = hidden[surfel]
        before, after, made_up = (m.parameters[name][whole] for m in (model, done, filled))
        assert len(before) > 20
        assert torch.equal(before, after)
        assert (made_up - before).abs().amax(dim=1).min() > 0
    before, after, made_up = (bare_colors(m) for m in (model, done, filled))
    assert before.max() > 1
    assert_close(after[shown == 0], before[shown == 0], atol=1e-6, rtol=0)
    assert (made_up - before)[shown == 0].abs().mean() > 0.1
    assert (after - before)[shown > 0].abs().mean() > 0.1


def shares(model, camera, opacity):
    """How much of the view each texel makes up [T]: the gradient of the sum of all pixels."""
    p = model.parameters
    texels = torch.ones_like(p["texels"]).requires_grad_()
    plain = torch.zeros_like(p["means"]), torch.ones_like(p["opacities"])
    texture = Texture(*plain, texels, p["sizes"], p["offsets"])
    image = model.rasterized(camera, opacity, texture=texture).color
    return torch.autograd.grad(image.sum(), texels)[0].sum(dim=1)


def stripes(views):
    """Dark and light stripes on the surface, over white."""
    is_dark = (views.points[..., 1:2] * 9) % 1 < 0.5
    alpha = views.alphas[..., None]
    return torch.where(is_dark, 0.2, 0.6) * alpha.expand(-1, -1, -1, 3) + 1 - alpha


def squared(observation, colors):
    """What the solver makes small."""
    return (observation.image(colors) - observation.wanted).square().sum()


@pytest.mark.parametrize(
    ("recipe", "loss", "target"),
    [(QUICK, squared, "colors"), (ADAM, image_loss, "images")],
    ids=["solve", "adam"],
)
def test_without_texture_each_surfel_learns_one_colour(model, recipe, loss, target):
    """It has a lower loss than the mean of the texels that would fit the edited views."""
    recipe, guidance = replace(recipe, target=target), Returns(stripes)
    done = edited(model, guidance, replace(recipe, is_textured=False))
    texels = done.parameters["texels"]
    assert texels.shape == model.parameters["texels"].shape, "it can be saved as a texture of the model"
    assert len(reduce_constant_textures(done).parameters["texels"]) == len(model)
    views = render_views(model, around(6), HEADLIGHT)
    rows = observe(model, views, stripes(views), HEADLIGHT, recipe.opacities, target=target)
    averaged = bare_colors(edited(model, guidance, recipe))
    averaged = spread_colors(
        bare_colors(with_single_texels(with_colors(model, averaged))), with_single_texels(model), model
    )
    losses = [
        sum(float(loss(observation, colors)) for row in rows for observation in row)
        for colors in (bare_colors(done), averaged, bare_colors(model))
    ]
    assert losses[0] < 0.99 * losses[1] < losses[2]


def test_at_half_the_opacity_the_papers_recipe_looks_like_the_edited_views():
    """The other one keeps the colours of the edit, which are paler then."""
    model, recipe = shell(opacity=0.5), TextRecipe("all", opacities=(0.5,), iterations=150, rate=0.05)
    wanted = render_views(
        with_colors(model, torch.full_like(model.parameters["texels"], 0.4)), around(6), None
    )
    error = {}
    for target in ("colors", "images"):
        done = edited(model, Returns(wanted.images), replace(recipe, target=target))
        opacities = (done.parameters["opacities"].sigmoid() / 2).logit()
        half = Surfels({**done.parameters, "opacities": opacities}, done.shading)
        error[target] = float((render_views(half, around(6), HEADLIGHT).images - wanted.images).abs().mean())
    assert error["images"] < 0.5 * error["colors"]


def test_six_views_of_the_size_asked_for_in_the_aspect_of_the_first(model):
    guidance = Tint((0.1, 0.2, 0.3))
    edit_by_text(model, [replace(c, width=48, height=24) for c in around(2)], guidance, "x", size=40)
    (views,) = guidance.seen
    assert views.images.shape == (6, 20, 40, 3)
    assert (directions(views.cameras).abs().amax(dim=1) > 0.999).all()
    filled = (views.alphas > 0).any(dim=2).float().mean(dim=1)
    assert (filled > 0.8).all()


def test_training_views_nearest_to_the_axes_as_they_are_but_for_their_size(model):
    guidance, cameras = Tint((0.1, 0.2, 0.3)), icosphere(4, Lens(3.0, 30.0, 64, 64))
    edit_by_text(model, cameras, guidance, "x", TextRecipe("nearest"), size=32)
    (views,) = guidance.seen
    assert views.images.shape == (6, 32, 32, 3)
    given = {tuple(camera.position.tolist()): camera for camera in cameras}
    for camera in views.cameras:
        original = given[tuple(camera.position.tolist())]
        shown, expected = model.render(camera).color, model.render(original).color
        mean = expected.unflatten(0, (32, 2)).unflatten(2, (32, 2)).mean((1, 3))
        assert (shown - mean).abs().mean() < 0.01


def broken(views):
    images = views.images.clone()
    images[0, 3, 4, 1] = torch.nan
    return images


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"guidance": Returns(broken)}, ArgumentError, "images edited by broken: .* finite .* got 1 NaN"),
        ({"guidance": Returns(torch.zeros(2, 9, 9, 3))}, ShapeError, r"by broken: expected \[2, 48, 48, 3\]"),
        ({"guidance": ProceduralFilters()}, ArgumentError, "expected one of stipple drawing"),
        ({"instruction": " "}, ArgumentError, "expected what to do in words"),
        ({"model": sample("shading")}, ArgumentError, "expected stage texture, got shading"),
        ({"surfels": torch.zeros(160) > 0}, ArgumentError, "at least one that may change as bool, got 0"),
        ({"surfels": torch.ones(3) > 0}, ShapeError, "surfels"),
        ({"recipe": RECIPES["paper"]}, ArgumentError, "cameras: expected 6 at least .*, got 2; .*views=axes"),
        ({"cameras": AWAY}, ArgumentError, "expected some that show what is to change, got none"),
    ],
)
def test_mistakes_are_reported_and_nothing_is_made_black(model, changes, error, message):
    given = {"model": model, "cameras": around(2), "guidance": Tint(BLUE), "instruction": "as van Gogh"}
    refused(lambda: edit_by_text(**{**given, "recipe": QUICK, **changes}), message, error)


FRONT, LEFT, TOP = torch.tensor([[0.0, 0, 1], [-1, 0, 0], [0, 1, 0]])  # from the object to the camera
AXES = torch.stack([FRONT, -FRONT, LEFT, -LEFT, TOP, -TOP])
BOX = torch.cat([torch.eye(3), -torch.eye(3)])  # points around the origin


def directions(cameras, center=0.0):
    return torch.stack([(camera.position - center) / (camera.position - center).norm() for camera in cameras])


@pytest.mark.parametrize("size", [(96, 40), (30, 80)])
def test_made_views_look_along_the_axes_and_are_filled_by_the_scene(size):
    points = torch.rand(500, 3, generator=torch.Generator().manual_seed(0))
    points = points * torch.tensor([1.0, 0.4, 0.6]) + 0.3
    like = replace(orbit(33, 44, 3.0, 40, 64, 64), width=size[0], height=size[1])
    cameras = axis_cameras(like, points)
    center = (points.amin(dim=0) + points.amax(dim=0)) / 2
    assert_close(directions(cameras, center), AXES, atol=1e-5, rtol=0)
    fullest = 0.0
    for camera in cameras:
        assert (camera.width, camera.height) == size
        assert_close((camera.position - center).norm(), (like.position - center).norm(), atol=1e-4, rtol=1e-4)
        relative = (camera.project(points)[0] / torch.tensor(size) - 0.5).abs().max()
        assert relative < 0.5
        fullest = max(fullest, float(relative))
    assert fullest > 0.45


def test_top_and_bottom_are_upright():
    """Going up from the front, the scene's front is below in the image: no turn on the way."""
    cameras = axis_cameras(orbit(0, 0, 3.0, 40, 10, 10), torch.eye(3))
    assert_close(cameras[4].viewmat[1, :3], torch.tensor([0.0, 0.0, 1.0]), atol=1e-6, rtol=0)
    assert_close(cameras[0].viewmat[1, :3], torch.tensor([0.0, -1.0, 0.0]), atol=1e-6, rtol=0)
    refused(lambda: axis_cameras(orbit(0, 0, 0.5, 40, 8, 8), BOX), "a camera well outside of the scene")


def test_each_view_is_chosen_once_and_the_sum_of_cosines_is_largest():
    generator = torch.Generator().manual_seed(1)
    angles = torch.rand(7, 2, generator=generator).tolist()  # all in one quarter: axes compete for them
    cameras = [orbit(90 * a, 60 * p, 3.0, 30, 8, 8) for a, p in angles]
    chosen = nearest_to_axes(cameras, BOX)
    cosines = AXES @ torch.stack([c.position / 3 for c in cameras]).T
    best = max(sum(float(cosines[k, i]) for k, i in enumerate(some)) for some in permutations(range(7), 6))
    total = sum(float(cosines[k, cameras.index(camera)]) for k, camera in enumerate(chosen))
    assert total == pytest.approx(best, abs=1e-5)
