import json
from itertools import combinations, pairwise
from math import acos, asin, atan, degrees, tan

import numpy as np
import pytest
import torch

from tests.real_data import real_data
from texgs.core.errors import ArgumentError
from texgs.core.lens import Lens
from texgs.volume import cameras
from texgs.volume.cameras import geodesic_vertices

RADIUS = 4.0311  # of the published views
LENS = Lens(RADIUS, 30.0, 80, 60)


def published(split):
    frames = json.loads(real_data(f"vortex/TF01/transforms_{split}.json").read_text())["frames"]
    matrices = np.array([frame["transform_matrix"] for frame in frames])  # [n, 4, 4] camera to world, OpenGL
    return matrices[:, :3] * [1, -1, -1, 1]


def camera_to_world(views):
    return np.linalg.inv(torch.stack([view.viewmat for view in views]).double().numpy())[:, :3]


def positions(views):
    return torch.stack([view.position for view in views]).double().numpy()


@pytest.mark.parametrize(
    ("split", "count", "ours"),
    [("train", 92, cameras.icosphere(3, LENS)), ("test", 181, cameras.spiral(181, LENS))],
)
def test_they_are_the_published_sets_view_by_view(split, count, ours):
    ours, theirs = camera_to_world(ours), published(split)
    assert ours.shape == theirs.shape == (count, 3, 4)
    np.testing.assert_allclose(ours, theirs, atol=2e-6)


@pytest.mark.parametrize("frequency", [1, 2, 3, 4, 5])
def test_icosphere_has_its_symmetries_and_is_even(frequency):
    vertices = geodesic_vertices(frequency)
    assert len(vertices) == 10 * frequency**2 + 2
    np.testing.assert_allclose(np.linalg.norm(vertices, axis=1), 1, atol=1e-15)
    cosine = vertices @ vertices.T
    np.testing.assert_allclose(cosine.min(axis=1), -1, atol=1e-14)  # the opposite of each is there
    np.fill_diagonal(cosine, -1)
    nearest = np.degrees(np.arccos(cosine.max(axis=1)))
    # An edge of the icosahedron spans 63.43 degrees; flat parts of it are smallest at its ends.
    edge = degrees(atan(2))
    assert 0.7 * edge / frequency < nearest.min() <= nearest.max() < 1.2 * edge / frequency
    # A five-fold axis: the moments of a set with icosahedral symmetry are isotropic.
    np.testing.assert_allclose(vertices.T @ vertices, np.eye(3) * len(vertices) / 3, atol=1e-12)


@pytest.mark.parametrize("frequency", [2, 4])
def test_icosphere_with_views_at_the_poles_stops_short_of_them(frequency):
    views = cameras.icosphere(frequency, LENS)
    heights = positions(views)[:, 1] / RADIUS
    assert (np.diff(heights) > -1e-6).all()
    np.testing.assert_allclose(heights[[0, -1]], [-1, 1], atol=1e-7)
    for pole in (0, -1):
        assert views[pole].viewmat[0, 1] == pytest.approx(0, abs=1e-7)  # the image's x axis is horizontal
        assert views[pole].viewmat[1, 1] == pytest.approx(-tan(np.radians(0.01)), rel=1e-2)  # +y is up


def test_162_views_hold_the_six_along_the_axes():
    directions = positions(cameras.icosphere(4, LENS)) / RADIUS
    for axis in np.vstack([np.eye(3), -np.eye(3)]):
        assert (directions @ axis).max() > 1 - 1e-6


def test_test_path_of_any_length_goes_from_pole_to_pole():
    ours = positions(cameras.spiral(7, LENS))
    full = positions(cameras.spiral(181, LENS))
    np.testing.assert_allclose(ours, full[::30], atol=1e-5)
    with pytest.raises(ArgumentError, match="count: expected at least 2 cameras on a path from pole to pole"):
        cameras.spiral(1, LENS)


def test_orbit_path_is_one_turn_without_its_end():
    views = cameras.orbit_path(4, 30, LENS)
    flat, up = RADIUS * np.cos(np.pi / 6), RADIUS / 2
    expected = [[0, up, flat], [flat, up, 0], [0, up, -flat], [-flat, up, 0]]
    np.testing.assert_allclose(positions(views), expected, atol=1e-6)
    assert (views[0].width, views[0].height) == (80, 60)


def test_cameras_are_spread_evenly_over_a_path():
    path = cameras.spiral(181, LENS)
    assert cameras.spread(path, 181) == cameras.spread(path, 500) == path
    places = [path.index(camera) for camera in cameras.spread(path, 61)]
    assert len(places) == 61
    assert {after - before for before, after in pairwise(places)} <= {2, 3}
    assert cameras.spread(path, 1) == path[:1]


def test_sights_are_far_apart_and_of_different_heights():
    """What is round about +y looks the same from one height."""
    seen = cameras.sights(LENS)
    directions = [view / np.linalg.norm(view) for view in positions(list(seen.values()))]
    for one, other in combinations(directions, 2):
        assert degrees(acos(one @ other)) > 90
        assert abs(degrees(asin(one[1])) - degrees(asin(other[1]))) >= 29.9
    assert list(seen) == ["front", "below", "above"]
    assert directions[0][2] > 0.9, "+z is in front"


def test_the_first_cameras_are_each_the_farthest_from_those_before():
    views = cameras.icosphere(3, LENS)
    places, order = positions(views), cameras.farthest_first(views)
    assert sorted(order) == list(range(92))
    assert order[0] == 0
    for count in range(1, 92):
        apart = np.linalg.norm(places[:, None] - places[order[:count]], axis=2).min(axis=1)
        assert apart[order[count]] == pytest.approx(apart.max(), rel=1e-6)
    assert cameras.farthest_first([views[0]] * 3) == [0, 1, 2]


@pytest.mark.parametrize(("count", "degrees"), [(54, 25), (98, 20)])
def test_a_part_of_the_training_views_leaves_no_side_out(count, degrees):
    views = cameras.icosphere(4, LENS)
    directions = positions(views) / RADIUS
    chosen = directions[cameras.farthest_first(views)[:count]]
    assert (directions @ chosen.T).max(axis=1).min() > np.cos(np.radians(degrees))
