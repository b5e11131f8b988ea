import numpy as np
import pytest

from texgs.core.errors import ArgumentError
from texgs.volume import voxels
from texgs.volume.grid import Grid
from texgs.volume.transfer import TransferFunction
from texgs.volume.voxels import visible_voxels

GREY = ((0.0, 0.5, 0.5, 0.5),)


def ramp(n=24):
    """A field that is the x index, on cells of 1 x 2 x 1."""
    return Grid(np.broadcast_to(np.arange(n, dtype=np.float32), (n, n, n)).copy(), (1.0, 2.0, 1.0))


def test_points_lie_where_the_volume_shows_in_world_units():
    tf = TransferFunction(((10, 0), (11, 1), (13, 1), (14, 0)), ((10, 1, 0, 0), (14, 0, 0, 1)))
    points, colors = visible_voxels(ramp(), tf, 1500, seed=0)
    low, high = np.array(ramp().aabb)
    assert points.shape == colors.shape == (1500, 3)
    assert points.dtype == np.float32
    assert ((points >= low - 1e-6) & (points <= high + 1e-6)).all()
    at = (points[:, 0] - low[0]) / (ramp().scale * 1.0)  # x index
    assert 10.4 < at.min() < at.max() < 13.6
    red = 1 - (np.round(at) - 10) / 4
    np.testing.assert_allclose(colors[:, 0], red, atol=0.26)
    np.testing.assert_allclose(points[:, 1:].mean(axis=0), 0, atol=0.02)


def test_chances_grow_with_opacity():
    tf = TransferFunction(((4, 0), (5, 0.1), (6, 0), (14, 0), (15, 0.4), (16, 0)), GREY)
    points, _ = visible_voxels(ramp(), tf, 200, seed=1)
    right = float((points[:, 0] > 0).mean())
    assert 0.72 < right < 0.88, "0.4 : 0.1"


def test_fewer_visible_samples_than_wanted_and_none():
    tf = TransferFunction(((10, 0), (11, 1), (12, 0)), GREY)
    points, _ = visible_voxels(ramp(6), TransferFunction(((0, 0), (1, 1), (2, 0)), GREY), 1000, seed=0)
    assert len(points) == 36
    with pytest.raises(ArgumentError, match="expected samples that the transfer function shows, found none"):
        visible_voxels(ramp(6), tf, 10, seed=0)


def test_large_volumes_are_looked_at_with_a_stride(monkeypatch):
    tf = TransferFunction(((10, 0), (11, 1), (13, 1), (14, 0)), GREY)
    monkeypatch.setattr(voxels, "MOST", 24**3 // 8)
    points, _ = visible_voxels(ramp(), tf, 10_000, seed=0)
    assert len(points) == 12 * 12, "every second sample along each axis: x = 12"
    again, _ = visible_voxels(ramp(), tf, 10_000, seed=0)
    np.testing.assert_array_equal(points, again)
