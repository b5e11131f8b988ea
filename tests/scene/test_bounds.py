"""How far models reach along a normal."""

import pytest
import torch

from tests.fields.surfels.test_composition import ball
from texgs.core.geometry import quats_to_matrices
from texgs.core.lens import Frame
from texgs.fields.surfels.model import Surfels
from texgs.scene.bounds import span_of

FRAME = Frame([0.0, 1.0, 0.0], 0.5)


def test_fields_without_means_count_as_the_ball_of_the_frame():
    assert span_of([], FRAME, [0.0, -1.0, 0.0]) == (-1.5, -0.5)


def test_models_reach_as_far_as_their_surfels_are_visible():
    """Beside points on the ellipses of two standard deviations, at half a degree from each other."""
    raw, normal = ball(1, n=400).parameters, torch.tensor([0.6, 0.0, 0.8])
    models = [Surfels({**raw, "means": raw["means"] + torch.tensor([x, 0, 0])}) for x in (-2.0, 3.0)]
    angle = torch.linspace(0, 2 * torch.pi, 721)[:, None]
    first, second = 2 * raw["scales"].exp().T * (quats_to_matrices(raw["quats"])[..., :2].mT @ normal).T
    rims = angle.cos() * first + angle.sin() * second  # along the normal [721, N]
    places = torch.cat([model.parameters["means"] @ normal for model in models])
    ends = (places + rims.amin(0).repeat(2)).sort().values, (places + rims.amax(0).repeat(2)).sort().values
    low, high = span_of(models, FRAME, normal.tolist())
    assert (low, high) == pytest.approx((float(ends[0][0]), float(ends[1][-1])), abs=1e-5)  # of the angles
    low, high = span_of(models, FRAME, normal.tolist(), 0.1)
    assert ends[0][79] < low < ends[0][80]
    assert ends[1][-81] < high < ends[1][-80]
