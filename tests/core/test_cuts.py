"""Planes and boxes of cuts: what they keep, and what they refuse."""

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from tests.refusals import refused
from texgs.core.cuts import Box, Cuts, Plane

COORDINATE = st.floats(-10, 10)
VECTOR = st.lists(COORDINATE, min_size=3, max_size=3)


def kept(cuts, points):
    """Which points all planes keep, with what lies on one."""
    inside = torch.ones(len(points), dtype=torch.bool)
    for plane in cuts.half_spaces:
        inside &= points @ torch.tensor(plane.normal, dtype=torch.float64) <= plane.offset
    return inside


@given(VECTOR.filter(lambda v: max(map(abs, v)) > 1e-3), COORDINATE, st.floats(1e-2, 1e2))
def test_a_plane_is_that_of_any_multiple_of_its_normal(normal, offset, factor):
    one, other = Plane(normal, offset), Plane([factor * each for each in normal], factor * offset)
    assert one.normal == pytest.approx(other.normal, abs=1e-9)
    assert one.offset == pytest.approx(other.offset, abs=1e-9, rel=1e-9)
    assert Plane(one.normal, one.offset) == one, "a plane that is read again is the same"


@given(VECTOR, VECTOR)
def test_a_box_keeps_what_is_between_its_corners(first, second):
    one, other = (torch.tensor(corner, dtype=torch.float64) for corner in (first, second))
    low, high = torch.minimum(one, other), torch.maximum(one, other) + 0.01
    points = torch.rand(200, 3, dtype=torch.float64) * 24 - 12
    inside = ((points >= low) & (points <= high)).all(dim=-1)
    assert torch.equal(kept(Cuts(box=Box(low.tolist(), high.tolist())), points), inside)


def test_what_is_no_cut_is_refused():
    refused(lambda: Plane([0.0, 0.0, 0.0]), "normal: ")
    refused(lambda: Plane([1.0, 0.0]), "normal: ")
    refused(lambda: Plane([0.0, 0.0, 1e-5], 100.0), r"offset: .*1e\+07")
    refused(lambda: Box([0.0] * 3, [1.0, 0.0, 1.0]), "box: ")
    refused(lambda: Box([0.0] * 2, [1.0] * 2), "box: ")
    refused(lambda: Cuts([Plane([1.0, 0.0, 0.0])] * 7), "planes: .*7")
    for window in ((5.0, 1.0), (1.0, 1.0)):
        refused(lambda ends=window: Cuts(window=ends), "window: expected black below white, got ")


def test_a_box_beside_six_planes_makes_twelve_half_spaces():
    cuts = Cuts([Plane([0.0, 1.0, 0.0], 0.2)] * 6, Box([-1.0] * 3, [1.0] * 3))
    assert len(cuts.half_spaces) == 12
    assert bool(cuts)
    assert not Cuts(faces="unlit")
