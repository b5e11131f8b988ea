"""Distances between surfaces in closed form, and what can be seen of them."""

import numpy as np
import pytest
import torch

from tests.refusals import refused
from texgs.core.lens import Lens
from texgs.metrics.surface import Points, are_visible, compare, distances, nearest, sample
from texgs.volume.cameras import icosphere
from texgs.volume.isosurface import Mesh

RADIUS = 0.4
CAMERAS = icosphere(1, Lens(4.0, 30.0, 101, 101))  # the origin is in the middle of a pixel


def sphere(radius, count=40_000, seed=0):
    directions = np.random.default_rng(seed).normal(size=(count, 3))
    normals = torch.from_numpy(directions / np.linalg.norm(directions, axis=1, keepdims=True))
    return Points(radius * normals, normals)


def test_points_of_a_mesh_are_even_and_face_outwards():
    """A square of two triangles, one of which is cut into a thousand."""
    fan = np.linspace(0, 1, 1001)
    corners = np.stack([fan, np.ones(1001), np.zeros(1001)], 1)
    vertices = np.concatenate([[[0, 0, 0], [1, 0, 0], [1, 1, 0]], corners]).astype(np.float32)
    triangles = [[0, 1, 2], *([0, 4 + i, 3 + i] for i in range(1000))]
    points = sample(Mesh(vertices, np.array(triangles, np.int32)), 20_000)
    assert torch.equal(points.normals, torch.tensor([0.0, 0, 1]).double().expand(20_000, 3))
    assert float((points.places[:, 0] > points.places[:, 1]).double().mean()) == pytest.approx(0.5, abs=0.02)
    assert points.places.mean(0).tolist() == pytest.approx([0.5, 0.5, 0], abs=0.01)
    again = sample(Mesh(vertices, np.array(triangles, np.int32)), 20_000)
    assert torch.equal(points.places, again.places)


def test_concentric_spheres_are_as_far_apart_as_their_radii():
    errors = compare(sphere(RADIUS + 0.02), sphere(RADIUS, seed=1), tolerance=0.03)
    assert errors.accuracy == pytest.approx(0.02, rel=0.03)
    assert errors.completeness == pytest.approx(0.02, rel=0.03)
    assert errors.chamfer == pytest.approx((errors.accuracy + errors.completeness) / 2)
    assert errors.f_score == 1
    assert errors.normal_angle < 1
    assert compare(sphere(RADIUS + 0.02), sphere(RADIUS), tolerance=0.01).f_score == 0


def test_half_of_a_surface_is_accurate_but_not_complete():
    whole = sphere(RADIUS)
    half = sphere(RADIUS, seed=1)
    half = half[half.places[:, 1] > 0]
    errors = compare(half, whole, tolerance=0.02)
    assert errors.precision == 1
    assert errors.recall == pytest.approx(0.5, abs=0.02)
    assert errors.f_score == pytest.approx(2 / 3, abs=0.02)
    assert errors.completeness > 20 * errors.accuracy


def test_the_angle_between_normals():
    flat = torch.cartesian_prod(torch.arange(30.0), torch.arange(30.0), torch.zeros(1)).double()
    up = torch.tensor([0.0, 0, 1]).double().expand(900, 3)
    tilted = torch.tensor([0.0, 0.6, 0.8]).double().expand(900, 3)
    distance, angle = distances(Points(flat, up), Points(flat + 0.1, tilted))
    assert distance.max() < 0.18
    assert angle.mean() == pytest.approx(np.degrees(np.arccos(0.8)))


def test_what_is_inside_of_another_surface_is_not_seen():
    outer, inner = sphere(RADIUS, 200_000), sphere(0.2, 50_000)
    both = Points(torch.cat([outer.places, inner.places]), torch.cat([outer.normals, inner.normals]))
    visible = are_visible(both, CAMERAS, tolerance=0.02)
    assert visible[:200_000].double().mean() > 0.99
    assert not visible[200_000:].any()
    assert are_visible(inner, CAMERAS, tolerance=0.02).double().mean() > 0.99
    one = are_visible(outer, CAMERAS[:1], tolerance=0.02)
    assert 0.4 < one.double().mean() < 0.5, "from a distance of ten radii not quite a half"


def test_the_nearest_point_of_a_pixel():
    camera = CAMERAS[0]
    away = torch.nn.functional.normalize(camera.position, dim=0).double()
    points = torch.stack([-0.3 * away, 0.3 * away, torch.zeros(3).double(), 100 * away])
    first, pixel, z = nearest(points, camera)
    middle = 50 * 101 + 50
    assert sorted(set(first.tolist())) == [-1, 1]
    assert (first >= 0).sum() == 1
    assert int(first.argmax()) == middle
    assert pixel[3] == -1, "behind the camera"
    assert z.tolist() == pytest.approx([4.3, 3.7, 4.0, -96.0], abs=1e-5)


@pytest.mark.parametrize("empty", [0, 1])
def test_a_surface_that_no_view_sees(empty):
    surfaces = [sphere(RADIUS, 100), sphere(RADIUS, 100)]
    surfaces[empty] = surfaces[empty][:0]
    name = ("mesh", "surface")[empty]
    refused(lambda: compare(*surfaces, tolerance=0.01), f"{name}: expected points to compare, got none")


def test_a_mesh_without_area_is_refused():
    flat = Mesh(np.zeros((3, 3), np.float32), np.array([[0, 1, 2]], np.int32))
    refused(lambda: sample(flat, 10), "expected triangles with an area, got none")
