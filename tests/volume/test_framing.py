"""The ball of what is visible, beside brute force."""

from itertools import combinations, product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize

from texgs.core.errors import ArgumentError
from texgs.core.lens import Frame
from texgs.volume.framing import frame_of, out_of_frame, shown_cells, shown_values, smallest_ball
from texgs.volume.grid import Grid
from texgs.volume.transfer import TransferFunction

WHITE = ((0, 1, 1, 1),)


def tf(*points):
    return TransferFunction(points, WHITE)


def circumscribed(points):
    """Centre of the smallest sphere through 2 to 4 points, by the normal equations; None: there is none."""
    sides = points[1:] - points[0]
    gram = 2 * sides @ sides.T
    if abs(np.linalg.det(gram)) < 1e-12:
        return None
    return points[0] + np.linalg.solve(gram, np.square(sides).sum(axis=1)) @ sides


def radius_by_brute_force(points):
    """The largest of the smallest balls around 2 to 4 of the points: that of all of them (Helly)."""
    best = np.inf
    for count in (2, 3, 4):
        for chosen in combinations(points, count):
            center = circumscribed(np.array(chosen))
            if center is not None:
                radius = np.linalg.norm(chosen[0] - center)
                if np.linalg.norm(points - center, axis=1).max() <= radius * (1 + 1e-9):
                    best = min(best, radius)
    return best


@given(st.integers(2, 9), st.integers(0, 2**32 - 1), st.sampled_from([1.0, 1e-3, 0.0]))
def test_the_ball_is_the_smallest_one(count, seed, thickness):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(count, 3)) * (1, 1, thickness) + rng.normal(size=3)
    frame = smallest_ball(points)
    assert frame.radius == pytest.approx(radius_by_brute_force(points), rel=1e-6)
    assert np.linalg.norm(points - frame.target, axis=1).max() <= frame.radius * (1 + 1e-6)


def test_many_points_and_those_of_a_lattice():
    """As far as a general minimiser gets; a box of voxels has its eight corners on the rim."""
    points = np.random.default_rng(1).uniform(size=(5000, 3)) ** 2
    frame = smallest_ball(points)
    found = minimize(lambda x: np.linalg.norm(points - x, axis=1).max(), frame.target, method="Nelder-Mead")
    assert frame.radius == pytest.approx(found.fun, rel=1e-5)
    assert np.linalg.norm(points - frame.target, axis=1).max() == pytest.approx(frame.radius, rel=1e-9)
    lattice = np.array(list(product(range(9), range(5), range(3))), dtype=float)
    box = smallest_ball(lattice)
    assert (*box.target, box.radius) == pytest.approx((4, 2, 1, np.sqrt(21)))
    assert smallest_ball(np.ones((3, 3))) == Frame([1, 1, 1], 0)


@given(st.integers(0, 2**32 - 1), st.sampled_from(["uint8", "int16", "float32"]))
def test_cells_show_what_they_interpolate(seed, dtype):
    """Beside the opacity of many values between the least and the largest sample of each cell."""
    rng = np.random.default_rng(seed)
    values = rng.integers(0, 10, (3, 4, 5)).astype(dtype)
    places = np.sort(rng.integers(0, 11, 4))
    opacity = rng.choice([0.0, 0.5], 4)
    if (np.diff(places) == 0).any() or not opacity.any():
        return
    function = tf(*zip(places.tolist(), opacity.tolist(), strict=True))
    shown = shown_cells(values, shown_values(function))
    for z, y, x in np.ndindex(2, 3, 4):
        cell = values[z : z + 2, y : y + 2, x : x + 2].astype(float)
        between = np.linspace(cell.min(), cell.max(), 1 + 20 * int(cell.max() - cell.min()))
        assert shown[z, y, x] == bool((function(between)[:, 3] > 0).any())


def test_all_basic_transfer_functions_are_framed_in_the_world():
    """Two voxels, one for each; spacing and slabs count."""
    values = np.zeros((40, 30, 20), dtype=np.uint8)
    values[5, 6, 7], values[35, 20, 10] = 100, 200
    grid = Grid(values, (1.0, 2.0, 1.5), (7.0, 8.0, 9.0))
    low, high = tf((90, 0), (100, 1), (110, 0)), tf((190, 0), (200, 1), (210, 0))
    scale = 1 / 58.5  # of the longest side, 39 x 1.5

    def world(x, y, z):
        return (np.array([x, y, z]) - (9.5, 14.5, 19.5)) * (1, 2, 1.5) * scale

    alone = frame_of(grid, [high])
    assert alone.target == pytest.approx(world(10, 20, 35), abs=1e-12)
    assert alone.radius == pytest.approx(np.linalg.norm((1, 2, 1.5)) * scale)
    first, last = world(6, 5, 4), world(11, 21, 36)
    both = frame_of(grid, [low, high])
    assert both.radius == pytest.approx(0.5 * np.linalg.norm(last - first), rel=1e-2)
    corners = [world(7 + i, 6 + j, 5 + k) for i, j, k in product((-1, 1), repeat=3)]
    corners += [world(10 + i, 20 + j, 35 + k) for i, j, k in product((-1, 1), repeat=3)]
    assert both.radius == pytest.approx(radius_by_brute_force(np.array(corners)), rel=1e-6)
    assert (
        out_of_frame(grid, low, both)
        == out_of_frame(grid, high, both)
        == out_of_frame(grid, high, alone)
        == ""
    )
    far = max(np.linalg.norm(corner - alone.target) for corner in corners[:8]) - alone.radius
    assert out_of_frame(grid, low, alone).startswith(f"reaches {far:.2g} out of the frame of radius 0.046: ")


def test_slabs_do_not_matter(monkeypatch):
    values = np.random.default_rng(0).normal(size=(9, 8, 7)).astype(np.float32)
    values[:, :, 0] = 0
    function = [tf((1.5, 0), (2, 1), (9, 1))]
    whole = frame_of(Grid(values), function)
    monkeypatch.setattr("texgs.volume.slabs.SLAB_BYTES", 1)
    assert frame_of(Grid(values), function) == whole


def test_nothing_visible():
    with pytest.raises(ArgumentError, match="expected some of the volume to be visible, got nothing"):
        frame_of(Grid(np.zeros((2, 2, 2), np.uint8)), [tf((1, 0), (2, 1))])


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_points_on_a_sphere_have_its_ball(dtype):
    directions = np.random.default_rng(0).normal(size=(20_000, 3))
    points = 0.3 * directions / np.linalg.norm(directions, axis=1, keepdims=True) + (0.1, -0.2, 0.05)
    frame = smallest_ball(points.astype(dtype))
    assert frame.target == pytest.approx((0.1, -0.2, 0.05), abs=1e-3)
    assert frame.radius == pytest.approx(0.3, abs=1e-4)
