"""How far away cameras show all that is framed."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from tests.refusals import refused
from texgs.core.camera import orbit
from texgs.core.lens import Frame, Lens


@given(
    st.tuples(*[st.floats(-3, 3)] * 3),
    st.floats(0.01, 5),
    st.floats(5, 120),
    st.tuples(st.integers(50, 400), st.integers(50, 400)),
    st.tuples(st.floats(-180, 180), st.floats(-80, 80)),
)
def test_a_framed_ball_fills_nine_tenths_of_the_smaller_side(target, radius, fov_y, size, place):
    camera = orbit(*place, *Frame(list(target), radius).lens(fov_y, *size))
    directions = torch.randn(20_000, 3, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    ball = torch.tensor(target) + radius * directions / directions.norm(dim=1, keepdim=True)
    pixels, depth = camera.project(ball)
    assert bool((depth > 0).all())
    low, high = pixels.amin(dim=0), pixels.amax(dim=0)
    # 20,000 random points leave at most a hundredth of the rim out.
    assert (high - low).numpy() == pytest.approx(0.9 * min(size), rel=0.02)
    assert (0.5 * (high + low)).numpy() == pytest.approx(0.5 * np.array(size), abs=0.01 * min(size))


def test_a_lens_is_that_of_the_paper_by_default():
    assert Lens() == (4.0311, 30.0, 800, 800, (0.0, 0.0, 0.0))
    assert Lens(target=(1.0, 2.0, 3.0)).square(7) == (4.0311, 30.0, 7, 7, (1.0, 2.0, 3.0))


@pytest.mark.parametrize("fov_y", [0, 180, float("nan")])
def test_a_field_of_view_is_between_0_and_180_degrees(fov_y):
    refused(lambda: Frame([0, 0, 0], 1).lens(fov_y), "fov_y: ")
