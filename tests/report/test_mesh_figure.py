import math

import numpy as np
import torch
from PIL import Image

from texgs.core.camera import orbit
from texgs.core.lens import Lens
from texgs.metrics.surface import sample
from texgs.report.mesh_figure import CLAY, render_points, shade, write_mesh_figure
from texgs.volume.isosurface import isosurface

RADIUS, DISTANCE, FOV, SIZE = 0.3, 2.0, 30.0, 160


def ball(radius=RADIUS):
    """The mesh of a sphere around the origin."""
    axis = np.linspace(-0.5, 0.5, 41)
    distance = np.sqrt(sum(x**2 for x in np.meshgrid(axis, axis, axis, indexing="ij")))
    return isosurface(radius - distance, 0.0, (0.025,) * 3, (-0.5,) * 3)


def test_a_ball_is_a_disc_without_holes_that_is_brightest_in_its_middle():
    mesh, camera = ball(), orbit(30, 20, DISTANCE, FOV, SIZE, SIZE)
    points = sample(mesh, 50_000)
    view = render_points(points, mesh, shade(points, camera), camera)
    rim = math.tan(math.asin(RADIUS / DISTANCE)) / math.tan(math.radians(FOV / 2))  # half image heights
    radius = math.sqrt(float(view.alpha.sum()) / math.pi)
    assert 0 < radius - rim * SIZE / 2 < 2, "pixels by which discs reach over the rim"
    y, x = torch.meshgrid(*[(torch.arange(SIZE) + 0.5) / SIZE * 2 - 1] * 2, indexing="ij")
    assert view.alpha[(x.square() + y.square()).sqrt() < 0.95 * rim].min() > 0.98
    assert abs(float(view.color[SIZE // 2, SIZE // 2, 0]) - CLAY) < 0.02


def test_the_error_of_a_larger_ball_is_the_difference_of_the_radii(tmp_path):
    small, large = ball(), ball(RADIUS + 0.01)
    surface = sample(small, 100_000)
    path = write_mesh_figure(tmp_path / "mesh.png", large, small, surface, Lens(), "a ball")
    again = write_mesh_figure(tmp_path / "again.png", large, small, surface, Lens(), "a ball")
    assert path.read_bytes() == again.read_bytes()
    with Image.open(path) as picture:
        pixels = np.asarray(picture.convert("RGB")).astype(int)
    half = np.array([188, 55, 84])  # of inferno, at 0.01 of 0.02
    width = pixels.shape[1]
    middle = pixels[pixels.shape[0] // 4, int(width * 0.84)]
    assert np.abs(middle - half).max() < 20
