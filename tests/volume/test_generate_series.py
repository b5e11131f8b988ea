"""Generated series: what moves, by how much, and that nothing jumps."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.ndimage import label

from texgs.volume.generate_series import SERIES, flame, series


@pytest.mark.parametrize("name", SERIES)
def test_a_series_has_its_steps_in_the_range_of_volumes_and_is_the_same_again(name):
    one, again = (series(name, 24, 5) for _ in range(2))
    assert len(one) == 5
    for grid, same in zip(one, again, strict=True):
        assert grid.values.dtype == np.float32
        assert grid.values.min() >= 0
        assert 0.5 < grid.values.max() <= 1
        np.testing.assert_array_equal(grid.values, same.values)
    assert all(np.abs(a.values - b.values).max() > 0.1 for a, b in pairwise(one))


@pytest.mark.parametrize("name", SERIES)
def test_more_steps_show_the_same_motion_more_finely(name):
    coarse, fine = series(name, 24, 3), series(name, 24, 5)
    for index, grid in enumerate(coarse):
        np.testing.assert_allclose(grid.values, fine[2 * index].values, atol=1e-6)


def test_rings_change_places_as_they_climb():
    """The radii in which vorticity lies below and above its middle are exchanged."""
    radii, heights = [], []
    axis = np.linspace(-1, 1, 64)
    z, y, x = np.meshgrid(axis, axis, axis, indexing="ij")
    for grid in series("rings", 64, 3):
        weights, distance = grid.values**2, np.hypot(x, z)
        heights.append((weights * y).sum() / weights.sum())
        wide = distance > 0.42
        radii.append([(weights * y * part).sum() / (weights * part).sum() for part in (wide, ~wide)])
    assert heights[0] < heights[1] < heights[2]
    assert abs(radii[0][0] - radii[0][1]) < 0.05  # both at one height: the narrow one is about to pass
    assert abs(radii[2][0] - radii[2][1]) < 0.05


def test_tongues_part_from_a_flame():
    parts = [label(grid.values > 0.15)[1] for grid in series("flame", 48, 20)]
    assert min(parts) == 1
    assert max(parts) > 1


def test_a_seed_makes_another_flame():
    one, other = (flame(24, 0.0, seed) for seed in (0, 1))
    assert np.abs(one.values - other.values).max() > 0.1
