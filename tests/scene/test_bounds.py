"""How far models reach along a normal."""

import pytest
import torch

from tests.fields.surfels.test_composition import ball
from texgs.core.lens import Frame
from texgs.fields.surfels.model import Surfels
from texgs.scene.bounds import span_of

FRAME = Frame([0.0, 1.0, 0.0], 0.5)


def test_fields_without_means_count_as_the_ball_of_the_frame():
    assert span_of([], FRAME, [0.0, -1.0, 0.0]) == (-1.5, -0.5)
    low, high = span_of([], FRAME, [0.0, 1.0, 0.0], 0.1)
    assert (low, high) == pytest.approx((0.6, 1.4))
    directions = torch.randn(10000, 3, generator=torch.Generator().manual_seed(0))
    places = 0.5 * torch.nn.functional.normalize(directions, dim=1).numpy()
    assert (places[:, 1] < low - 1).mean() == pytest.approx(0.1, abs=0.015)  # five standard deviations


def test_models_reach_as_far_as_their_surfels_are_visible():
    raw = ball(1, n=400).parameters
    models = [Surfels({**raw, "means": raw["means"] + torch.tensor([x, 0, 0])}) for x in (-2.0, 3.0)]
    along = torch.cat([model.parameters["means"] for model in models]) @ torch.tensor([0.6, 0.0, 0.8])
    reach = 2 * raw["scales"].exp().amax(dim=1).repeat(2)
    low, high = span_of(models, FRAME, [0.6, 0.0, 0.8])
    assert low == pytest.approx(float((along - reach).min()), abs=1e-6)  # means are in single precision
    assert high == pytest.approx(float((along + reach).max()), abs=1e-6)
    low, high = span_of(models, FRAME, [0.6, 0.0, 0.8], 0.1)
    assert int((along - reach < low).sum()) == int((along + reach > high).sum()) == 80
