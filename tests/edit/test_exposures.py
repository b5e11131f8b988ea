"""Edited views as linear equations: against explicit blending and closed forms."""

import pytest
import torch
from torch.testing import assert_close

from tests.edit.textured import around, shell
from texgs.core.light import Light
from texgs.edit.exposures import content, expose, straight_colors
from texgs.edit.target_views import render_views
from texgs.fields.surfels.texels import bare_colors

HEADLIGHT = Light("headlight")


@pytest.fixture(scope="module")
def model():
    return shell()


def exposed(model, edited=None, light=None, opacities=(1.0,), surfels=None, count=3):
    """Views, what they should look like, and the equations."""
    views = render_views(model, bare_colors(model), around(count), light)
    images = views.images if edited is None else edited(views)
    return views, expose(model, views, images, light, opacities, surfels)


def pasted(exposure, part, size=48):
    """A part of an image in its place."""
    left, top = (round(24 - float(x)) for x in (exposure.camera.K[0, 2], exposure.camera.K[1, 2]))
    whole = torch.zeros(size, size, *part.shape[2:])
    whole[top : top + part.shape[0], left : left + part.shape[1]] = part
    return whole


@pytest.mark.parametrize("light", [None, HEADLIGHT])
def test_views_that_are_not_edited_are_solved_by_the_colours_they_have(model, light):
    views, ((first, *_),) = exposed(model, light=light)
    p = model.parameters
    image = first.image(bare_colors(model), p["sizes"], p["offsets"])
    alpha = views.alphas[0][..., None]
    assert_close(pasted(first, image) + 1 - alpha, views.images[0], atol=2e-5, rtol=0)
    is_solid = first.cover > 0.9
    assert_close(first.wanted[is_solid], image.detach()[is_solid], atol=0.01, rtol=0)


@pytest.mark.parametrize("factor", [2.0, 0.5])
def test_at_another_opacity_the_same_colour_is_wanted_at_its_alpha(model, factor):
    color = torch.tensor([0.3, 0.5, 0.9])
    _, ((first, *_),) = exposed(
        model, lambda v: color * v.alphas[..., None] + 1 - v.alphas[..., None], opacities=(factor,)
    )
    assert_close(
        first.wanted, first.cover[..., None] * color.expand(*first.cover.shape, 3), atol=2e-3, rtol=0
    )
    opacities = (model.parameters["opacities"].sigmoid() * factor).clamp_max(1)
    assert_close(first.opacities, opacities)


def test_surfels_that_may_not_change_are_black_and_not_wanted(model):
    upper = model.parameters["means"][:, 1] > 0
    p = model.parameters
    rows = [exposed(model, surfels=mask)[1][0] for mask in (upper, ~upper, None)]
    for top, bottom, both in zip(*rows, strict=True):
        images = [
            pasted(e, e.image(bare_colors(model), p["sizes"], p["offsets"])) for e in (top, bottom, both)
        ]
        assert_close(images[0] + images[1], images[2], atol=1e-5, rtol=0)
        covers = [pasted(e, e.cover) for e in (top, bottom, both)]
        assert_close(covers[0] + covers[1], covers[2], atol=1e-5, rtol=0)
        wanted = [pasted(e, e.wanted) for e in (top, bottom, both)]
        assert_close(wanted[0] + wanted[1], wanted[2], atol=1e-5, rtol=0)


def test_crops_hold_all_content():
    cover = torch.zeros(60, 80)
    cover[20:30, 40:41] = 0.1
    left, top, right, bottom = content(cover)
    assert (left, top, right, bottom) == (29, 9, 52, 41)
    assert content(torch.zeros(5, 6)) == (0, 0, 1, 1)


def test_straight_colours_are_those_that_were_blended_over_white():
    generator = torch.Generator().manual_seed(0)
    alpha = torch.rand(20, 30, generator=generator) * 0.5 + 0.5
    color = torch.tensor([0.2, 0.9, 0.4]) + 0.05 * torch.rand(20, 30, 3, generator=generator)
    straight = straight_colors(color * alpha[..., None] + 1 - alpha[..., None], alpha)
    assert_close(straight, color, atol=6e-3, rtol=0)


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


def test_views_of_nothing_want_nothing(model):
    assert_close(straight_colors(torch.ones(6, 7, 3), torch.zeros(6, 7)), torch.zeros(6, 7, 3))
