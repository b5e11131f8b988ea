"""What a guidance sees of textured surfels, and its edits as linear equations: against the renderer."""

from dataclasses import replace

import pytest
import torch
from torch.testing import assert_close

from tests.edit.scenes import SHELL, around, shell
from tests.refusals import refused
from texgs.core.light import HEADLIGHT, Light
from texgs.edit.observations import content, observe, render_views, straight_colors
from texgs.fields.surfels.composition import Composition
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.texels import bare_colors, owners


@pytest.fixture(scope="module")
def model():
    return shell()


@pytest.mark.parametrize("light", [None, Light("directional", 40, 30)])
def test_views_are_those_of_a_scene(model, light):
    """Up to the clamping of highlights, of which this material has none that bright."""
    camera = around()[0]
    views = render_views(model, [camera], light)
    look = "unshaded" if light is None else "shaded"
    scene = Composition([model]).render(camera, light or HEADLIGHT, look=look)
    assert_close(views.images[0], scene.color.clamp(0, 1), atol=1e-5, rtol=0)
    assert_close(views.alphas[0], scene.alpha)


def test_textures_may_lie_in_any_order(model):
    """In reverse order, with a gap between any two."""
    p = model.parameters
    counts = p["sizes"].long().prod(1)
    offsets = ((counts + 2).flip(0).cumsum(0) - (counts + 2).flip(0)).flip(0)
    texels = torch.full((int((counts + 2).sum()), 3), 9.0)
    moved = Surfels({**p, "texels": texels, "offsets": offsets}, model.shading, model.metadata)
    texels[owners(moved.parameters)[0]] = p["texels"][owners(p)[0]]
    one, other = (render_views(m, around()[:1], None).images for m in (model, moved))
    assert_close(one, other, atol=1e-6, rtol=0)


def test_points_lie_on_the_sphere_and_normals_point_from_it():
    views = render_views(shell(opacity=6.0), around(4), None)
    inside = views.alphas > 0.99
    points, normals = views.points[inside], views.normals[inside]
    assert int(inside.sum()) > 500
    assert_close(points.norm(dim=1).median(), torch.tensor(SHELL), atol=0.03, rtol=0)
    assert torch.nn.functional.cosine_similarity(points, normals, dim=1).median() > 0.95


def test_views_of_several_sizes_are_refused(model):
    cameras = around(2)
    other = replace(cameras[1], width=20)
    refused(lambda: render_views(model, [cameras[0], other], None), "all of one size")
    refused(lambda: render_views(model, [], None), "at least one")


def observed(model, edited=None, light=None, opacities=(1.0,), surfels=None):
    """Views, and the observations of what they should look like."""
    views = render_views(model, around(3), light)
    images = views.images if edited is None else edited(views)
    return views, observe(model, views, images, light, opacities, surfels)


def cover(observation):
    """Share of the surfels that change, where all else is white."""
    return 1 - observation.rest[..., 0]


def with_opacity(model, factor):
    """The model with its opacities times a factor."""
    opacities = (model.parameters["opacities"].sigmoid() * factor).clamp(1e-7, 1 - 1e-7).logit()
    return Surfels({**model.parameters, "opacities": opacities}, model.shading)


def pasted(observation, part, size=48):
    """A part of an image in its place."""
    left, top = (round(24 - float(x)) for x in (observation.camera.K[0, 2], observation.camera.K[1, 2]))
    whole = torch.zeros(size, size, *part.shape[2:])
    whole[top : top + part.shape[0], left : left + part.shape[1]] = part
    return whole


@pytest.mark.parametrize("light", [None, HEADLIGHT])
def test_views_that_are_not_edited_are_solved_by_the_colours_they_have(model, light):
    views, ((first, *_),) = observed(model, light=light)
    image = first.image(bare_colors(model))
    alpha = views.alphas[0][..., None]
    assert_close(pasted(first, image) + 1 - alpha, views.images[0], atol=2e-5, rtol=0)
    is_solid = cover(first) > 0.9
    assert_close(first.wanted[is_solid], image.detach()[is_solid], atol=0.01, rtol=0)


@pytest.mark.parametrize("factor", [2.0, 0.5])
def test_at_another_opacity_the_same_colour_is_wanted_at_its_alpha(model, factor):
    color = torch.tensor([0.3, 0.5, 0.9])
    _, ((first, *_),) = observed(model, lambda v: 1 - v.alphas[..., None] * (1 - color), opacities=(factor,))
    assert_close(first.wanted, cover(first)[..., None] * color, atol=2e-3, rtol=0)
    alpha = with_opacity(model, factor).render(first.camera).alpha
    assert_close(cover(first), alpha, atol=1e-5, rtol=0)


@pytest.mark.parametrize("light", [None, HEADLIGHT])
@pytest.mark.parametrize("share", ["all", "some"])
def test_as_in_the_paper_the_edited_image_itself_is_wanted_at_every_opacity(model, share, light):
    """What surfels should add, and what else there is, make it; what they add now makes the view."""
    upper = None if share == "all" else model.parameters["means"][:, 1] > 0
    views = render_views(model, around(2), light)
    edited = torch.rand(views.images.shape, generator=torch.Generator().manual_seed(3))
    rows = observe(model, views, edited, light, (2.0, 0.5), upper, target="images")
    for factor, row in zip((2.0, 0.5), rows, strict=True):
        now = render_views(with_opacity(model, factor), around(2), light).images
        for observation, wanted, shown in zip(row, edited, now, strict=True):
            inside = pasted(observation, torch.ones(observation.rest.shape[:2])) > 0
            whole = observation.wanted + observation.rest
            assert_close(pasted(observation, whole)[inside], wanted[inside], atol=1e-6, rtol=0)
            image = observation.image(bare_colors(model)) + observation.rest
            assert_close(pasted(observation, image).clamp(0, 1)[inside], shown[inside], atol=2e-5, rtol=0)


def test_surfels_that_may_not_change_are_black_and_not_wanted(model):
    upper = model.parameters["means"][:, 1] > 0
    rows = [observed(model, surfels=mask)[1][0] for mask in (upper, ~upper, None)]
    for each in zip(*rows, strict=True):
        for part in (lambda e: e.image(bare_colors(model)), cover, lambda e: e.wanted):
            top, bottom, both = (pasted(e, part(e)) for e in each)
            assert_close(top + bottom, both, atol=1e-5, rtol=0)


def test_crops_hold_all_content():
    covered = torch.zeros(60, 80)
    covered[20:30, 40:41] = 0.1
    assert content(covered) == (29, 9, 52, 41)
    assert content(torch.zeros(5, 6)) == (0, 0, 1, 1)


def test_straight_colours_are_those_that_were_blended_over_white():
    generator = torch.Generator().manual_seed(0)
    alpha = torch.rand(20, 30, generator=generator) * 0.5 + 0.5
    color = torch.tensor([0.2, 0.9, 0.4]) + 0.05 * torch.rand(20, 30, 3, generator=generator)
    straight = straight_colors(color * alpha[..., None] + 1 - alpha[..., None], alpha)
    assert_close(straight, color, atol=6e-3, rtol=0)
    assert_close(straight_colors(torch.ones(6, 7, 3), torch.zeros(6, 7)), torch.zeros(6, 7, 3))


def test_straight_colours_go_on_beyond_the_silhouette_and_bear_noise_there():
    alpha = torch.zeros(40, 40)
    alpha[10:30, 10:30] = 1
    alpha[10:30, 30] = 0.01  # the rim
    color = torch.tensor([0.1, 0.6, 0.3])
    image = color * alpha[..., None] + 1 - alpha[..., None]
    image[10:30, 30] += 0.02  # twice as much as is to be seen there
    straight = straight_colors(image, alpha)
    assert_close(straight[20, 20], color, atol=1e-4, rtol=0)
    assert (straight[15:25, 30:36] - color).abs().max() < 0.25  # divided by alpha alone it would be white
