"""Functions that overlap: extinctions add up at every value, and colours are weighed by them."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from tests.volume.functions import GREY, STEPS, functions
from texgs.volume.overlay import overlay
from texgs.volume.transfer import TransferFunction, combine, overlapping

OFF = np.arange(-1000, 1000) / 32 + 1 / 64  # off the grid of points


def together(tfs, values):
    """Opacity and colour of all of them, value by value."""
    seen = np.stack([tf(values) for tf in tfs])
    extinction = -np.log1p(-np.minimum(seen[..., 3], 1 - 1e-9))
    with np.errstate(invalid="ignore"):
        color = (extinction[..., None] * seen[..., :3]).sum(0) / extinction.sum(0)[:, None]
    return 1 - np.prod(1 - seen[..., 3], axis=0), color


def test_two_that_do_not_overlap_are_combined():
    low = TransferFunction(((0, 0), (1, 0.5)), GREY)
    high = TransferFunction(((1, 0.2), (2, 0)), GREY)
    assert overlapping({"low": low, "high": high}) is None
    assert overlay({"low": low, "high": high}) == combine({"low": low, "high": high})


@given(st.lists(functions(), min_size=2, max_size=4))
def test_opacities_and_colours_of_any(tfs):
    seen = overlay(dict(enumerate(tfs)))
    opacity, color = together(tfs, OFF)
    assert seen(OFF)[:, 3].max() <= 1
    np.testing.assert_allclose(seen(OFF)[:, 3], opacity, atol=0.04)
    error = opacity[:, None] * np.abs(seen(OFF)[:, :3] - color)  # as far as it is seen
    assert np.nanmean(error) < 0.05
    is_calm = np.max([tf(OFF)[:, 3] for tf in tfs], axis=0) < 0.8  # opaque ones outweigh all
    assert np.nanmax(error[is_calm], initial=0) < 0.2


def test_steps_and_ends_stay_where_they_are():
    block = TransferFunction(((0.5, 0.6), (1.5, 0.6)), GREY)
    seen = overlay({"steps": STEPS, "block": block})
    for value in (0.5, 1, 1.5):
        values = np.array([value - 1e-5, value, value + 1e-5])
        np.testing.assert_allclose(seen(values)[:, 3], together([STEPS, block], values)[0], atol=1e-3)


def test_opaque_ones_stay_opaque():
    solid = TransferFunction(((0, 1), (1, 1)), ((0, 1, 0, 0),))
    seen = overlay({"a": solid, "b": TransferFunction(((0.5, 0.5), (2, 0.5)), ((0, 0, 0, 1),))})
    np.testing.assert_allclose(seen(0.75), [1, 0, 0, 1], atol=0.05)
    assert math.isclose(seen(1.5)[3], 0.5)
