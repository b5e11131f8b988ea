"""Isosurfaces of fields in closed form."""

import numpy as np
import pytest

from texgs.core.errors import ArgumentError
from texgs.volume.grid import Grid
from texgs.volume.isosurface import isosurface, opaque_ranges, surface_of
from texgs.volume.transfer import TransferFunction

WHITE = [(0.0, 1.0, 1.0, 1.0)]


def ball(size=48, dtype=np.float32):
    """1 in the middle of the box, 0 at the distance 1 of half a side, linear in between."""
    axis = np.linspace(-1, 1, size)
    z, y, x = np.meshgrid(axis, axis, axis, indexing="ij")
    return (1 - np.sqrt(x**2 + y**2 + z**2)).astype(dtype)


def signed_volume(mesh):
    a, b, c = mesh.corners.transpose(1, 0, 2)
    return (np.cross(a, b) * c).sum() / 6


def test_a_ball_has_its_radius_and_faces_outwards():
    step = 1 / 47
    mesh = isosurface(ball(), 0.4, (step,) * 3, (-0.5,) * 3)
    radii = np.linalg.norm(mesh.vertices, axis=1)
    assert np.abs(radii - 0.3).max() < 0.02 * step
    assert signed_volume(mesh) == pytest.approx(4 / 3 * np.pi * 0.3**3, rel=0.01)


def test_spacing_and_origin_are_x_y_z():
    values = np.zeros((4, 6, 8), np.float32)
    values[1:3, 1:5, 1:7] = 1
    mesh = isosurface(values, 0.5, (1.0, 2.0, 3.0), (10.0, 20.0, 30.0))
    low, high = mesh.vertices.min(0), mesh.vertices.max(0)
    assert low.tolist() == [10.5, 21.0, 31.5]
    assert high.tolist() == [16.5, 29.0, 37.5]


def test_a_level_that_is_not_reached_has_no_surface():
    mesh = isosurface(ball(), 2.0, (1.0,) * 3, (0.0,) * 3)
    assert mesh.vertices.shape == mesh.triangles.shape == (0, 3)


def test_ranges_in_which_a_function_is_opaque():
    tf = TransferFunction([(0.2, 0.0), (0.4, 0.8), (0.6, 0.8), (1.0, 0.0)], WHITE)
    assert opaque_ranges(tf, 0.4) == [(pytest.approx(0.3), pytest.approx(0.8))]
    two = TransferFunction([(0.0, 0.0), (0.2, 0.8), (0.4, 0.0), (0.6, 0.8), (0.8, 0.0)], WHITE)
    assert np.allclose(opaque_ranges(two, 0.4), [(0.1, 0.3), (0.5, 0.7)])
    step = TransferFunction([(0.2, 0.9), (0.6, 0.9)], WHITE)
    assert opaque_ranges(step, 0.5) == [(0.2, 0.6)]
    assert opaque_ranges(tf, 0.9) == []


@pytest.mark.parametrize("dtype", [np.float32, np.uint8])
def test_a_shell_has_two_sides(dtype):
    scale = 1 if dtype == np.float32 else 200
    grid = Grid((scale * ball().clip(0, 1)).astype(dtype), (2.0, 2.0, 2.0))
    tf = TransferFunction(
        [(0.2 * scale, 0.0), (0.4 * scale, 1.0), (0.6 * scale, 1.0), (0.8 * scale, 0.0)], WHITE
    )
    mesh = surface_of(grid, tf, 0.5)
    radii = np.linalg.norm(mesh.vertices, axis=1)
    outer, inner = 0.5 * (1 - 0.3), 0.5 * (1 - 0.7)
    assert np.minimum(np.abs(radii - outer), np.abs(radii - inner)).max() < 0.005
    assert signed_volume(mesh) == pytest.approx(4 / 3 * np.pi * (outer**3 - inner**3), rel=0.02)


def test_what_is_cut_by_the_box_ends_there():
    """A slab through the whole volume: its sides are faces of the box."""
    values = np.zeros((8, 8, 8), np.float32)
    values[3:5] = 1
    tf = TransferFunction([(0.0, 0.0), (1.0, 1.0)], WHITE)
    mesh = surface_of(Grid(values), tf, 0.5)
    assert np.abs(mesh.vertices[:, :2]).max() == pytest.approx(0.5, abs=1e-3)
    assert signed_volume(mesh) == pytest.approx(2 / 7, rel=0.01)


def test_a_glassy_function_has_no_surface():
    tf = TransferFunction([(0.2, 0.0), (0.4, 0.1), (0.6, 0.0)], WHITE)
    with pytest.raises(ArgumentError, match=r"as opaque as 0\.5 somewhere in the volume.*another basic TF"):
        surface_of(Grid(ball()), tf, 0.5)
