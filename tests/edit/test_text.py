"""Text-driven editing from end to end, offline."""

import pytest
import torch

from tests.edit.guidances import Tint, Watching
from tests.edit.textured import around, shell
from texgs.core.errors import ArgumentError
from texgs.core.lens import Lens
from texgs.edit.target_views import render_views
from texgs.edit.text import RECIPES, edit_by_text
from texgs.fields.surfels.texels import bare_colors, untextured
from texgs.models.filters import ProceduralFilters
from texgs.volume.cameras import icosphere


@pytest.fixture(scope="module")
def model():
    return shell()


def test_six_views_of_the_size_asked_for_in_the_aspect_of_the_first(model):
    guidance = Watching((0.1, 0.2, 0.3))
    wide = [type(c)(c.viewmat, c.K, 48, 24) for c in around(2)]
    edit_by_text(model, wide, guidance, "x", size=40)
    (views,) = guidance.seen
    assert views.images.shape == (6, 20, 40, 3)
    directions = torch.stack([camera.position / camera.position.norm() for camera in views.cameras])
    assert (directions.abs().amax(dim=1) > 0.999).all()
    filled = (views.alphas > 0).any(dim=2).float().mean(dim=1)
    assert (filled > 0.8).all()


def test_training_views_nearest_to_the_axes_as_they_are_but_for_their_size(model):
    guidance = Watching((0.1, 0.2, 0.3))
    cameras = icosphere(4, *Lens(3.0, 30.0, 64, 64))
    edit_by_text(model, cameras, guidance, "x", views="nearest", size=32)
    (views,) = guidance.seen
    assert views.images.shape == (6, 32, 32, 3)
    given = {tuple(camera.position.tolist()): camera for camera in cameras}
    for camera in views.cameras:
        original = given[tuple(camera.position.tolist())]
        shown, expected = model.render(camera).color, model.render(original).color
        mean = expected.unflatten(0, (32, 2)).unflatten(2, (32, 2)).mean((1, 3))
        assert (shown - mean).abs().mean() < 0.01


def test_the_papers_recipe():
    paper = RECIPES["paper"].policy
    assert (paper.iterations, paper.rate, paper.final) == (1500, 0.025, 1.0)
    assert (paper.opacities[0], paper.opacities[-1]) == (2.0, 0.5)
    assert RECIPES["paper"].views == "nearest"


def test_refinement_keeps_some_of_the_first_style(model):
    """Dots, then blue: the dots are blue."""
    cameras = around(4)
    dots = edit_by_text(model, cameras, ProceduralFilters(2.0), "as a stipple drawing", size=96).model
    both = edit_by_text(dots, cameras, ProceduralFilters(2.0), "make it blue", size=96).model
    plain = edit_by_text(model, cameras, ProceduralFilters(2.0), "make it blue", size=96).model
    shown = [render_views(m, bare_colors(m), cameras, None) for m in (dots, both, plain)]
    solid = shown[0].alphas > 0.95
    ink, blue, alone = (views.images[solid] for views in shown)
    assert (blue[:, 2] - blue[:, 0]).mean() > 0.2
    pattern = torch.corrcoef(torch.stack([ink.mean(dim=1), blue.mean(dim=1)]))[0, 1]
    assert pattern > 0.6
    assert blue.std(dim=0).mean() > 2 * alone.std(dim=0).mean()


def test_without_texture_some_surfels_have_one_colour_and_others_stay(model):
    half = torch.arange(len(model)) % 2 == 0
    plain = untextured(model, half)
    p, offsets = plain.parameters, model.parameters["offsets"].tolist()
    for n, count in enumerate(model.parameters["sizes"].prod(1).tolist()):
        own, now = (q["texels"][offsets[n] : offsets[n] + count] for q in (model.parameters, p))
        assert torch.equal(now, now[:1].expand_as(now) if half[n] else own)
    assert (untextured(model).parameters["texels"] != model.parameters["texels"]).any()


def test_bad_arguments(model):
    with pytest.raises(ArgumentError, match="recipe: expected one of default, paper, got 'fast'"):
        edit_by_text(model, around(2), Tint((0, 0, 0)), "x", "fast")
    with pytest.raises(ArgumentError, match="cameras: expected those of the training views, got none"):
        edit_by_text(model, [], Tint((0, 0, 0)), "x")
    with pytest.raises(ArgumentError, match="views: expected one of axes, nearest, all, got 'some'"):
        edit_by_text(model, around(2), Tint((0, 0, 0)), "x", views="some")
    with pytest.raises(ArgumentError, match=r"cameras: expected 6 at least .*, got 2; .*views=axes"):
        edit_by_text(model, around(2), Tint((0, 0, 0)), "x", "paper")
    with pytest.raises(ArgumentError, match="size: expected at least 1 pixel"):
        edit_by_text(model, around(2), Tint((0, 0, 0)), "x", size=0)
    with pytest.raises(ArgumentError, match="expected one of stipple drawing"):
        edit_by_text(model, around(2), ProceduralFilters(), "in the style of van Gogh")
