"""A guidance whose views disagree, on top of others."""

import pytest
import torch

from tests.edit.guidances import Tint
from tests.models.views_of import random_views
from tests.refusals import refused
from texgs.core.camera import orbit
from texgs.models.filters import ProceduralFilters
from texgs.models.guidance import Disagreeing

GREY = (0.5, 0.5, 0.5)


def generator(seed=0):
    return torch.Generator().manual_seed(seed)


def many(count):
    """Small views from one place."""
    return random_views(count, height=4, width=4, cameras=[orbit(0, 0, 3.0, 30, 4, 4)] * count)


def test_without_an_amount_it_is_the_other_guidance():
    views, filters = random_views(3), ProceduralFilters()
    edited = Disagreeing(filters, 0.0)(views, "a stipple drawing", generator())
    torch.testing.assert_close(edited, filters(views, "a stipple drawing", generator()))
    assert Disagreeing(filters, 0.0).lit == filters.lit
    refused(lambda: Disagreeing(filters, -1), "disagreement: ")


def test_colours_are_off_by_a_factor_for_each_view_and_channel_and_white_stays():
    views = many(400)
    edited = Disagreeing(Tint(GREY), 0.1)(views, "anything", generator())
    inside = views.alphas[0] > 0
    assert (edited[:, ~inside] == 1).all()
    colors = edited[:, inside]
    assert torch.equal(colors, colors[:, :1].expand_as(colors)), "one factor for all of a view"
    factors = colors[:, 0] / 0.5
    assert float(factors.mean()) == pytest.approx(1, abs=0.01)
    assert float(factors.std()) == pytest.approx(0.1, rel=0.1)
    assert abs(float(factors.T.corrcoef()[0, 1])) < 0.15


def test_the_other_guidance_sees_points_elsewhere_and_all_else_as_it_is():
    views, other = many(300), Tint(GREY)
    Disagreeing(other, 0.2)(views, "anything", generator())
    (seen,) = other.seen
    shifts = seen.points - views.points
    assert float(shifts[:, 0, 0].std()) == pytest.approx(0.2, rel=0.1)
    torch.testing.assert_close(shifts, shifts[:, :1, :1].expand_as(shifts), atol=1e-6, rtol=0)
    assert seen.images is views.images
    assert seen.cameras is views.cameras


def test_the_same_generator_gives_the_same_images_and_each_call_others():
    views, guidance = random_views(2), Disagreeing(ProceduralFilters(), 0.1)
    drawn = generator()
    first, second = (guidance(views, "pencil hatching", drawn) for _ in range(2))
    assert torch.equal(first, guidance(views, "pencil hatching", generator()))
    assert not torch.equal(first, second)
    assert 0 <= first.min() <= first.max() <= 1
