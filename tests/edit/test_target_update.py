"""The loop of views, guidance and texels: what it changes, what it leaves, and what it refuses."""

from dataclasses import replace

import pytest
import torch
from torch.testing import assert_close

from tests.edit.guidances import Identity, NoisyTint, Returns, Tint, Watching
from tests.edit.textured import around, shell
from tests.fields.surfels.samples import sample
from texgs.core.errors import ArgumentError, ShapeError
from texgs.core.light import Light
from texgs.edit.target_views import render_views
from texgs.edit.text import Policy, update
from texgs.fields.part_edit import PartEdit
from texgs.fields.surfels.composition import Composition
from texgs.fields.surfels.texels import bare_colors, owners, recolored

BLUE = (0.2, 0.3, 0.8)
QUICK = Policy(opacities=(1.0, 0.5), sweeps=2)
ADAM = Policy(opacities=(1.0, 0.5), iterations=150, rate=0.05)
CHANGES = {"texels", "colors"}
TURNED = torch.diag(torch.tensor([-1.0, 1.0, -1.0, 1.0]))  # half a turn about the upright axis


@pytest.fixture(scope="module")
def model():
    return shell()


def seen(model, count=5):
    """Bare colours from other sides than those that were edited."""
    return render_views(model, bare_colors(model), around(count + 4)[2:-2], None)


def same_rest(one, other):
    return all(
        torch.equal(x, other.parameters[name]) for name, x in one.parameters.items() if name not in CHANGES
    )


@pytest.mark.parametrize("policy", [QUICK, ADAM], ids=["solve", "adam"])
def test_a_tint_is_seen_from_everywhere_and_the_rest_stays(model, policy):
    done = update(model, around(6), Tint(BLUE), "make it blue", policy)
    assert same_rest(model, done.model)
    assert done.model.metadata == model.metadata
    views = seen(done.model)
    solid = views.alphas > 0.95
    assert (views.images[solid] - torch.tensor(BLUE)).abs().mean() < 0.01
    before, after = (render_views(m, bare_colors(m), around(3), None) for m in (model, done.model))
    assert torch.equal(before.alphas, after.alphas)
    assert torch.equal(before.normals, after.normals)
    assert torch.equal(before.points, after.points)


def test_light_falls_on_what_was_edited_bare(model):
    """Under any light the edited scene is shaded as a scene of that colour is."""
    done = update(model, around(6), Tint(BLUE), "x", QUICK)
    p = model.parameters
    plain = recolored(model, torch.tensor(BLUE).expand(len(p["texels"]), 3))
    for light in (Light("headlight"), Light("directional", 70, 20)):
        camera = around(3)[1]
        color, expected = (Composition([m]).render(camera, light).color for m in (done.model, plain))
        assert_close(color, expected, atol=0.03, rtol=0)


def test_lit_edits_look_as_wanted_under_the_light_of_the_edit(model):
    cameras = around(6)
    done = update(model, cameras, Tint((0.4, 0.5, 0.3), lit=True), "x", QUICK)
    views = render_views(done.model, bare_colors(done.model), cameras, Light("headlight"))
    solid = views.alphas > 0.95
    assert (views.images[solid] - torch.tensor([0.4, 0.5, 0.3])).abs().mean() < 0.02
    bare = update(model, cameras, Tint((0.4, 0.5, 0.3), lit=True), "x", QUICK, lit=False).model
    darker = render_views(bare, bare_colors(bare), cameras, Light("headlight"))
    assert (darker.images[solid] - torch.tensor([0.4, 0.5, 0.3])).abs().mean() > 0.04


def test_identity_changes_nothing_that_is_seen(model):
    done = update(model, around(8), Identity(lit=False), "as it is", Policy())
    before, after = seen(model), seen(done.model)
    assert (before.images - after.images).abs().mean() < 0.004


def test_only_chosen_surfels_change(model):
    upper = model.parameters["means"][:, 1] > 0
    done = update(model, around(6), Tint(BLUE), "x", QUICK, surfels=upper)
    place, surfel = owners(model.parameters)
    p, q = model.parameters, done.model.parameters
    assert torch.equal(p["colors"][~upper], q["colors"][~upper])
    kept = place[~upper[surfel]]
    assert torch.equal(p["texels"][kept], q["texels"][kept])
    colors = bare_colors(done.model)
    assert (colors[place[upper[surfel]]] - torch.tensor(BLUE)).abs().mean() < 0.02


def test_the_palette_still_recolours(model):
    done = update(model, around(6), Tint((0.5, 0.5, 0.5)), "x", QUICK)
    shift = torch.tensor([0.2, -0.1, 0.1])
    edit = PartEdit(palette=tuple((model.parameters["palette"] + shift).tolist()))
    scene, camera = Composition([done.model]), around(3)[0]
    plain = scene.render(camera, look="unshaded")
    moved = scene.render(camera, edits=[edit], look="unshaded")
    solid = plain.alpha > 0.95
    assert_close((moved.color - plain.color)[solid].mean(dim=0), shift, atol=0.01, rtol=0)


def test_highlights_keep_their_colour():
    """A dark edit of a bright model: where highlights saturate, they are white, not the old colour's rest."""
    bright = shell(opacity=6.0)
    p = {**bright.parameters, "specular": torch.tensor([3.0])}
    bright = recolored(
        type(bright)(p, bright.shading), torch.tensor([[1.0, 1.0, 0.1]]).expand(len(p["texels"]), 3)
    )
    done = update(bright, around(6), Tint((0.1, 0.1, 0.1)), "x", QUICK)
    shown = Composition([done.model]).render(around(6)[3]).color[20:28, 20:28]
    assert shown.max() > 0.6
    assert (shown.amax(dim=-1) - shown.amin(dim=-1)).max() < 0.05


def test_refinement_sees_the_first_result(model):
    first = update(model, around(6), Tint(BLUE), "make it blue", QUICK)
    guidance = Watching((0.9, 0.1, 0.1))
    second = update(first.model, around(6), guidance, "make it red", QUICK)
    (views,) = guidance.seen
    solid = views.alphas > 0.95
    assert (views.images[solid] - torch.tensor(BLUE)).abs().mean() < 0.02
    assert torch.equal(views.images, views.conditions)
    assert (
        seen(second.model).images[seen(model).alphas > 0.95] - torch.tensor([0.9, 0.1, 0.1])
    ).abs().mean() < 0.02


def test_same_seed_same_model(model):
    guidance = NoisyTint(BLUE, 0.2)
    one, two, other = (
        update(model, around(6), guidance, "x", QUICK, seed=seed).model.parameters["texels"]
        for seed in (1, 1, 2)
    )
    assert torch.equal(one, two)
    assert not torch.equal(one, other)


def test_share_of_texels_seen(model):
    solid = Policy(opacities=(2.0,), sweeps=1)
    every = update(model, around(10), Identity(), "x", solid).seen
    front = update(model, around(1), Identity(), "x", solid).seen
    assert 0.2 < front < 0.75
    assert every > 0.95


def test_unseen_sides_have_the_new_colour(model):
    done = update(model, around(1), Tint(BLUE), "x", QUICK)
    back = seen(done.model)
    assert (back.images[back.alphas > 0.95] - torch.tensor(BLUE)).abs().max() < 0.1


def broken(views):
    images = views.images.clone()
    images[0, 3, 4, 1] = torch.nan
    return images


@pytest.mark.parametrize(
    ("images", "error", "message"),
    [
        (broken, ArgumentError, r"images edited by broken: expected finite values, got 1 NaN"),
        (torch.zeros(2, 9, 9, 3), ShapeError, r"images edited by broken: expected \[2, 48, 48, 3\]"),
        (torch.zeros(48, 48, 3), ShapeError, r"images edited by broken: expected"),
    ],
)
def test_bad_edits_are_reported(model, images, error, message):
    with pytest.raises(error, match=message):
        update(model, around(2), Returns(images), "x", QUICK)


def test_a_part_that_no_view_shows_is_told_and_not_made_black(model):
    away = [replace(camera, viewmat=TURNED @ camera.viewmat) for camera in around(2)]
    with pytest.raises(ArgumentError, match="expected some that show what is to change, got none"):
        update(model, away, Tint(BLUE), "x", QUICK)


def test_bad_arguments(model):
    with pytest.raises(ArgumentError, match="expected what to do in words"):
        update(model, around(2), Tint(BLUE), " ", QUICK)
    with pytest.raises(ArgumentError, match="expected stage texture, got shading"):
        update(sample("shading"), around(2), Tint(BLUE), "x", QUICK)
    with pytest.raises(ArgumentError, match="expected at least one that may change as bool, got 0"):
        update(model, around(2), Tint(BLUE), "x", surfels=torch.zeros(len(model), dtype=torch.bool))
    with pytest.raises(ShapeError, match="surfels"):
        update(model, around(2), Tint(BLUE), "x", surfels=torch.ones(3, dtype=torch.bool))


@pytest.mark.parametrize(
    "values",
    [
        {"sweeps": 0},
        {"iterations": -1},
        {"rate": 0.0},
        {"final": 0.0},
        {"opacities": ()},
        {"opacities": (1.0, 0.0)},
    ],
)
def test_policies_out_of_range(values):
    with pytest.raises(ArgumentError, match=next(iter(values))):
        Policy(**values)
