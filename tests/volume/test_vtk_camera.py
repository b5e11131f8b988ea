from dataclasses import replace

import numpy as np
import pytest
import torch

from texgs.core.camera import orbit
from texgs.core.errors import ArgumentError
from texgs.core.light import Light
from texgs.volume.vtk_camera import aim, directions, point_light

vtk = pytest.importorskip("vtkmodules.vtkRenderingCore")


@pytest.mark.parametrize(("width", "height"), [(200, 200), (320, 100), (90, 240)])
@pytest.mark.parametrize(("azimuth", "polar"), [(-90, 0), (33, 50), (120, -90)])
def test_vtk_projects_points_as_we_do(width, height, azimuth, polar):
    camera = orbit(azimuth, polar, 2.5, 40, width, height)
    target = vtk.vtkCamera()
    aim(target, camera)
    matrix = target.GetCompositeProjectionTransformMatrix(width / height, -1, 1)
    composite = np.array([[matrix.GetElement(i, j) for j in range(4)] for i in range(4)])
    points = np.random.default_rng(0).uniform(-0.5, 0.5, (20, 3))
    clip = np.c_[points, np.ones(20)] @ composite.T
    ndc = clip[:, :2] / clip[:, 3:]
    theirs = np.c_[(ndc[:, 0] + 1) * width / 2, (1 - ndc[:, 1]) * height / 2]
    viewmat, K = camera.viewmat.double().numpy(), camera.K.double().numpy()
    ours = (points @ viewmat[:3, :3].T + viewmat[:3, 3]) @ K.T
    np.testing.assert_allclose(theirs, ours[:, :2] / ours[:, 2:], atol=1e-3)


@pytest.mark.parametrize(
    ("entry", "value", "focal"), [((0, 0), 90.0, "90, 109.899"), ((1, 2), 31.0, "40, 31")]
)
def test_a_lens_that_vtk_does_not_have_is_an_error(entry, value, focal):
    camera = orbit(0, 0, 2, 40, 80, 80)
    K = camera.K.clone()
    K[entry] = value
    with pytest.raises(ArgumentError, match=rf"principal point \(40.0, 40.0\), got focal lengths .*{focal}"):
        aim(vtk.vtkCamera(), replace(camera, K=K))


def test_a_headlight_shines_along_the_optical_axis_and_the_other_from_its_place():
    camera, light = orbit(-60, 20, 2, 40, 80, 80), vtk.vtkLight()
    axis = -camera.viewmat[2, :3].numpy()
    to_viewer, to_light = directions(camera, Light("headlight"))
    np.testing.assert_allclose(to_viewer, axis, atol=1e-7)
    np.testing.assert_array_equal(to_viewer, to_light)
    point_light(light, camera, Light("headlight"))
    np.testing.assert_allclose(light.GetPosition(), axis, atol=1e-7)
    assert light.GetFocalPoint() == (0, 0, 0)
    to_viewer, to_light = directions(camera, Light("directional", 90, 0))
    np.testing.assert_allclose(to_viewer, axis, atol=1e-7)
    np.testing.assert_allclose(to_light, [0, 0, -1], atol=1e-12)
    point_light(light, camera, Light("directional", 90, 0))
    np.testing.assert_allclose(light.GetPosition(), [0, 0, -1], atol=1e-12)
    assert torch.tensor(to_light).norm() == pytest.approx(1)
