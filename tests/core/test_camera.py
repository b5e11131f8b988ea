"""Cameras, the lenses that frame what is to be seen, and lights."""

from math import radians, tan

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chisquare, kstest

from tests.refusals import refused
from texgs.core.camera import Camera, intrinsics, look_at, orbit, orbit_direction
from texgs.core.errors import ShapeError
from texgs.core.lens import Frame, Lens
from texgs.core.light import Light, random_lights


def project(camera, point):
    """The definition: matrices and homogeneous coordinates."""
    x, y, z = camera.viewmat[:3, :3] @ torch.tensor(point) + camera.viewmat[:3, 3]
    u, v, w = camera.K @ torch.stack([x, y, z])
    return float(u / w), float(v / w), float(z)


def test_points_go_to_the_pixels_of_the_definition_and_back():
    camera = orbit(30, 20, radius=3, fov_y=40, width=7, height=5).crop(1, 1, 6, 5)
    depth = 2 + torch.rand(4, 5)
    points = camera.unproject(depth)
    pixels, z = camera.project(points)
    torch.testing.assert_close(z, depth)
    for row in range(4):
        for column in range(5):
            expected = (column + 0.5, row + 0.5, float(depth[row, column]))
            assert project(camera, points[row, column].tolist()) == pytest.approx(expected, abs=1e-4)
            assert pixels[row, column].tolist() == pytest.approx(expected[:2], abs=1e-4)
    torch.testing.assert_close(camera.position + depth[..., None] * camera.rays(), points)
    torch.testing.assert_close(camera.ray_lengths(), camera.rays().norm(dim=-1))
    refused(lambda: camera.unproject(depth.T), "depth: ", ShapeError)


@pytest.mark.parametrize(("longer", "size"), [(14, (14, 10)), (3, (3, 2)), (1, (1, 1))])
def test_another_resolution_shows_the_same_places_at_the_same_shares(longer, size):
    camera = orbit(30, 20, radius=3, fov_y=40, width=7, height=5)
    other = camera.resized(longer)
    assert (other.width, other.height) == size
    points = torch.rand(20, 3) - 0.5
    shares = [view.project(points)[0] / torch.tensor([view.width, view.height]) for view in (camera, other)]
    torch.testing.assert_close(*shares)


def test_orbit_sees_the_origin_in_the_middle_and_up_above():
    camera = orbit(-90, 0, radius=3, fov_y=40, width=200, height=100)
    torch.testing.assert_close(camera.position, torch.tensor([0.0, 0.0, 3.0]))
    assert project(camera, [0.0, 0.0, 0.0]) == pytest.approx((100, 50, 3), abs=1e-4)
    # The top edge is at half the field of view, and +x is on the right.
    assert project(camera, [0.0, 3 * tan(radians(20)), 0.0]) == pytest.approx((100, 0, 3), abs=1e-4)
    assert project(camera, [0.1, 0.0, 0.0])[0] > 100


@pytest.mark.parametrize("polar", [-90, -30, 0, 89.99, 90])
def test_orbit_is_a_rotation_everywhere(polar):
    camera = orbit(123, polar, radius=2, fov_y=30, width=8, height=8)
    R_cw = camera.viewmat[:3, :3]
    torch.testing.assert_close(R_cw @ R_cw.T, torch.eye(3), atol=1e-6, rtol=0)
    assert torch.linalg.det(R_cw) == pytest.approx(1, abs=1e-6)
    torch.testing.assert_close(camera.position, 2 * orbit_direction(123, polar).float(), atol=1e-6, rtol=0)
    expected = torch.tensor([0.0, 0.5, -(0.75**0.5)], dtype=torch.float64)
    torch.testing.assert_close(orbit_direction(90, 30), expected, atol=1e-15, rtol=0)


def test_look_at_is_differentiable_in_the_position():
    position = torch.tensor([1.0, 2.0, 3.0], dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(lambda p: look_at(p, torch.zeros(3, dtype=torch.float64)), position)


def test_mistakes_are_named():
    eye, zero, up = torch.eye(4), torch.zeros(3), torch.tensor([0.0, 1.0, 0.0])
    refused(lambda: look_at(zero, zero), "position and target")
    refused(lambda: look_at(up, zero), "not along up")
    refused(lambda: orbit(0, 91, 1, 40, 8, 8), "polar: ")
    refused(lambda: orbit(0, 0, 0, 40, 8, 8), "radius: ")
    refused(lambda: intrinsics(180, 8, 8), "fov_y: ")
    refused(lambda: Camera(eye, torch.eye(3), 8, 0), "height: ")
    refused(lambda: Camera(eye[:3], torch.eye(3), 8, 8), "viewmat: ", ShapeError)


def test_an_orbit_around_a_target_is_one_around_the_origin_moved():
    target = torch.tensor([0.3, -1.2, 2.0])
    still, moved = (orbit(40, 25, 2.5, 30, 64, 48, place) for place in ((0, 0, 0), target.tolist()))
    points = torch.randn(20, 3, generator=torch.Generator().manual_seed(0)) * 0.3
    for one, other in zip(still.project(points), moved.project(points + target), strict=True):
        torch.testing.assert_close(one, other, atol=1e-4, rtol=1e-5)  # pixels and lengths, of float32
    assert still.viewmat.equal(orbit(40, 25, 2.5, 30, 64, 48).viewmat)


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


CAMERA = orbit(0, 0, 3, 30, 8, 8)


def directions(lights):
    return np.stack([light.direction(CAMERA).numpy() for light in lights])


@pytest.mark.parametrize("azimuth", [float("nan"), float("inf")])
def test_an_azimuth_that_is_no_angle_is_refused(azimuth):
    refused(lambda: Light("directional", azimuth), f"azimuth: .*{azimuth}")


@pytest.mark.parametrize("seed", [(0,), (0, 2), (7, 1)])
def test_random_lights_are_uniform_on_the_sphere(seed):
    # Coordinates along any axis are uniform on [-1, 1], and as many lights are in one octant as in another.
    xyz = directions(random_lights(4000, *seed))
    np.testing.assert_allclose(np.linalg.norm(xyz, axis=1), 1, rtol=1e-12)
    for axis in (*np.eye(3), np.full(3, 3**-0.5)):
        assert kstest(xyz @ axis, "uniform", (-1, 2)).pvalue > 0.01
    octants = (xyz > 0) @ [1, 2, 4]
    assert chisquare(np.bincount(octants, minlength=8)).pvalue > 0.01


def test_a_seed_has_the_same_lights_again_and_more_begin_with_them():
    assert random_lights(9, 3, 1) == random_lights(9, 3, 1)
    assert random_lights(9, 3, 1)[:4] == random_lights(4, 3, 1)
    drawn = {light for seed in ((3, 1), (3, 0), (4, 1)) for light in random_lights(9, *seed)}
    assert len(drawn) == 27
