"""Isosurfaces of fields in closed form, and points where a volume shows."""

import numpy as np
import pytest

from tests.volume.scenes import ball
from texgs.core.errors import ArgumentError
from texgs.volume.grid import Grid
from texgs.volume.isosurface import isosurface, opaque_ranges, surface_of
from texgs.volume.transfer import TransferFunction

WHITE = [(0.0, 1.0, 1.0, 1.0)]


def signed_volume(mesh):
    a, b, c = mesh.corners.transpose(1, 0, 2)
    return (np.cross(a, b) * c).sum() / 6


def test_a_ball_has_its_radius_and_faces_outwards():
    step = 1 / 47
    mesh = isosurface(ball().values, 0.4, (step,) * 3, (-0.5,) * 3)
    radii = np.linalg.norm(mesh.vertices, axis=1)
    assert np.abs(radii - 0.3).max() < 0.02 * step
    assert signed_volume(mesh) == pytest.approx(4 / 3 * np.pi * 0.3**3, rel=0.01)
    none = isosurface(ball().values, 2.0, (1.0,) * 3, (0.0,) * 3)  # a level that is not reached
    assert none.vertices.shape == none.triangles.shape == (0, 3)
    glassy = TransferFunction([(0.2, 0.0), (0.4, 0.1), (0.6, 0.0)], WHITE)
    with pytest.raises(ArgumentError, match=r"as opaque as 0\.5 somewhere in the volume.*another basic TF"):
        surface_of(ball(), glassy, 0.5)


def test_spacing_and_origin_are_x_y_z():
    values = np.zeros((4, 6, 8), np.float32)
    values[1:3, 1:5, 1:7] = 1
    mesh = isosurface(values, 0.5, (1.0, 2.0, 3.0), (10.0, 20.0, 30.0))
    assert mesh.vertices.min(0).tolist() == [10.5, 21.0, 31.5]
    assert mesh.vertices.max(0).tolist() == [16.5, 29.0, 37.5]


def test_ranges_in_which_a_function_is_opaque():
    tf = TransferFunction([(0.2, 0.0), (0.4, 0.8), (0.6, 0.8), (1.0, 0.0)], WHITE)
    assert opaque_ranges(tf, 0.4) == [(pytest.approx(0.3), pytest.approx(0.8))]
    two = TransferFunction([(0.0, 0.0), (0.2, 0.8), (0.4, 0.0), (0.6, 0.8), (0.8, 0.0)], WHITE)
    assert np.allclose(opaque_ranges(two, 0.4), [(0.1, 0.3), (0.5, 0.7)])
    step = TransferFunction([(0.2, 0.9), (0.6, 0.9)], WHITE)
    assert opaque_ranges(step, 0.5) == [(0.2, 0.6)]
    assert opaque_ranges(tf, 0.9) == []


@pytest.mark.parametrize(("dtype", "scale"), [(np.float32, 1), (np.uint8, 200)])
def test_a_shell_has_two_sides(dtype, scale):
    grid = Grid((scale * ball().values.clip(0, 1)).astype(dtype), (2.0, 2.0, 2.0))
    points = [(0.2 * scale, 0.0), (0.4 * scale, 1.0), (0.6 * scale, 1.0), (0.8 * scale, 0.0)]
    mesh = surface_of(grid, TransferFunction(points, WHITE), 0.5)
    radii = np.linalg.norm(mesh.vertices, axis=1)
    outer, inner = 0.5 * (1 - 0.3), 0.5 * (1 - 0.7)
    assert np.minimum(np.abs(radii - outer), np.abs(radii - inner)).max() < 0.005
    assert signed_volume(mesh) == pytest.approx(4 / 3 * np.pi * (outer**3 - inner**3), rel=0.02)


def test_what_is_cut_by_the_box_ends_there():
    """A slab through the whole volume: its sides are faces of the box."""
    values = np.zeros((8, 8, 8), np.float32)
    values[3:5] = 1
    mesh = surface_of(Grid(values), TransferFunction([(0.0, 0.0), (1.0, 1.0)], WHITE), 0.5)
    assert np.abs(mesh.vertices[:, :2]).max() == pytest.approx(0.5, abs=1e-3)
    assert signed_volume(mesh) == pytest.approx(2 / 7, rel=0.01)


def test_missing_samples_are_clear():
    values = ball().values.clip(0, 1).astype(np.float32)
    points = TransferFunction([(0.4, 1.0), (1.0, 1.0)], WHITE)
    whole = surface_of(Grid(values, (2.0, 2.0, 2.0)), points, 0.5)
    values[0, 0, 0] = np.nan
    assert np.array_equal(surface_of(Grid(values, (2.0, 2.0, 2.0)), points, 0.5).vertices, whole.vertices)
