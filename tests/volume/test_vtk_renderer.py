import contextlib
import subprocess
import sys
from dataclasses import replace
from unittest.mock import Mock

import numpy as np
import pytest
from vtkmodules.vtkRenderingCore import vtkCamera, vtkLight

from tests.real_data import real_data
from tests.volume.scenes import SHELLS, ball, over_white, psnr
from texgs.core.camera import orbit
from texgs.core.errors import ArgumentError, DeviceError
from texgs.core.light import HEADLIGHT, Light
from texgs.volume import opengl
from texgs.volume.caster import Caster
from texgs.volume.grid import Grid
from texgs.volume.render import Appearance
from texgs.volume.sources import open_source
from texgs.volume.transfer import TransferFunction
from texgs.volume.vtk_renderer import VtkRenderer, aim, image_data, point_light, volume_property

LIGHTS = [HEADLIGHT, Light("directional", 30, 40), Light("directional", -130, -20)]


@pytest.fixture(scope="module")
def offscreen():
    try:
        opengl.offscreen_opengl()
    except DeviceError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="module")
def renderers(offscreen):
    look = Appearance(step=0.5, opacity_unit=0.01)
    return VtkRenderer(ball(), look), Caster(ball(), look)


@pytest.mark.parametrize("light", LIGHTS)
@pytest.mark.parametrize(("width", "height"), [(160, 160), (120, 80), (64, 100)])
def test_both_see_the_same_on_a_ball(renderers, light, width, height):
    camera = orbit(-60, 20, 2.5 * max(1, height / width), 30, width, height)
    vtk, own = (renderer.render(SHELLS, camera, light) for renderer in renderers)
    assert vtk.shape == (height, width, 4)
    assert vtk.dtype == own.dtype
    assert psnr(vtk[..., 3], own[..., 3]) > 50
    assert psnr(over_white(vtk), over_white(own)) > 15  # highlights differ


@pytest.mark.parametrize("light", LIGHTS[:2])
def test_both_see_the_same_on_a_real_volume(offscreen, light):
    source = open_source(real_data("volumes/engine.vti"))
    grid = Grid(source.slices(0, source.dims[2]), source.spacing, source.origin)
    tf = TransferFunction(((130, 0), (160, 0.2), (200, 0.2), (201, 0.8), (255, 0.8)), ((0, 0.9, 0.5, 0.2),))
    look, camera = Appearance(step=0.5), orbit(-60, 20, 2.2, 30, 160, 160)
    vtk, own = (kind(grid, look).render(tf, camera, light) for kind in (VtkRenderer, Caster))
    assert psnr(vtk[..., 3], own[..., 3]) > 37
    assert psnr(over_white(vtk), over_white(own)) > 15


def test_a_view_does_not_depend_on_the_one_before(renderers):
    camera, vtk = orbit(-60, 20, 2.5, 30, 60, 60), renderers[0]
    first = vtk.render(SHELLS, camera, LIGHTS[1])
    assert len(set(first[..., 3].ravel().tolist())) > 300, "more than 8 bits"
    other = TransferFunction(((0.1, 0), (0.4, 0.9)), ((0, 1, 0, 0),))
    assert psnr(vtk.render(other, orbit(20, -30, 3, 40, 90, 40), HEADLIGHT).max(), first.max()) < 200
    assert (vtk.render(SHELLS, camera, LIGHTS[1]) == first).all()


def test_a_step_in_opacity_draws_no_warning(offscreen):
    program = """
from tests.volume.scenes import ball
from texgs.core.camera import orbit
from texgs.core.light import HEADLIGHT
from texgs.volume.render import Appearance
from texgs.volume.transfer import TransferFunction
from texgs.volume.vtk_renderer import VtkRenderer
tf = TransferFunction(((0.5, 0.3), (0.7, 0.3), (0.7, 0.9), (1, 0.9)), ((0.5, 1, 0, 0), (0.7, 0, 1, 0)))
picture = VtkRenderer(ball(24), Appearance(step=1)).render(tf, orbit(0, 0, 3, 30, 32, 32), HEADLIGHT)
assert picture[16, 16, 3] > 0.9
"""
    child = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert (child.returncode, child.stdout + child.stderr) == (0, "")


@pytest.mark.parametrize(("width", "height"), [(200, 200), (320, 100), (90, 240)])
@pytest.mark.parametrize(("azimuth", "polar"), [(-90, 0), (33, 50), (120, -90)])
def test_vtk_projects_points_as_we_do(width, height, azimuth, polar):
    camera, target = orbit(azimuth, polar, 2.5, 40, width, height), vtkCamera()
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
        aim(vtkCamera(), replace(camera, K=K))


def test_a_light_shines_from_its_place_to_the_origin():
    camera, light = orbit(-60, 20, 2, 40, 80, 80), vtkLight()
    point_light(light, camera, HEADLIGHT)
    np.testing.assert_allclose(light.GetPosition(), -camera.viewmat[2, :3], atol=1e-7)
    assert light.GetFocalPoint() == (0, 0, 0)
    point_light(light, camera, Light("directional", 90, 0))
    np.testing.assert_allclose(light.GetPosition(), [0, 0, -1], atol=1e-12)


def test_the_image_lies_where_the_grid_does():
    values = np.arange(2 * 3 * 5, dtype=np.float32).reshape(2, 3, 5)
    grid = Grid(values, (1.0, 3.0, 2.0), (7.0, 8.0, 9.0))
    image, factor = image_data(grid)
    assert (factor, image.GetDimensions()) == (1, (5, 3, 2))
    np.testing.assert_allclose(np.reshape(image.GetBounds(), (3, 2)).T, grid.aabb)
    assert image.GetScalarComponentAsDouble(4, 1, 1, 0) == values[1, 1, 4]
    values[0, 0, 0] = 77  # the samples are not copied
    assert image.GetScalarComponentAsDouble(0, 0, 0, 0) == 77


@pytest.mark.parametrize(("dtype", "wide"), [("uint8", "unsigned short"), ("int8", "short")])
def test_8_bits_become_16_over_the_whole_range(dtype, wide):
    info = np.iinfo(dtype)
    values = np.linspace(info.min, info.max, 27).astype(dtype).reshape(3, 3, 3)
    image, factor = image_data(Grid(values))
    assert image.GetScalarTypeAsString() == wide
    assert image.GetScalarRange() == (info.min * factor, info.max * factor)


@pytest.mark.parametrize("factor", [1.0, 128.0])
@pytest.mark.parametrize("ramp", [None, 0.01])
def test_vtk_has_the_transfer_function(factor, ramp):
    tf = TransferFunction(((2, 0.5), (4, 0.5), (4, 0.1), (8, 0)), ((2, 1, 0, 0), (6, 0, 1, 0)))
    prop = volume_property(tf, Appearance(opacity_unit=0.02, shininess=7), factor, ramp)
    values = np.array([0, 1.9, 2, 3, 3.9, 4, 5, 7, 8, 9])
    opacity = [prop.GetScalarOpacity().GetValue(value * factor) for value in values]
    color = [prop.GetRGBTransferFunction().GetColor(value * factor) for value in values]
    at_its_start = values != 2  # a step at the first point is a ramp from there
    np.testing.assert_allclose(np.array(opacity)[at_its_start], tf(values)[at_its_start, 3], atol=1e-5)
    np.testing.assert_allclose(color, tf(values)[:, :3], atol=1e-5)
    assert (prop.GetScalarOpacityUnitDistance(), prop.GetSpecularPower()) == (0.02, 7)
    assert prop.GetShade()


def answer(monkeypatch, **fields):
    child = subprocess.CompletedProcess([], **({"returncode": 0, "stdout": "", "stderr": ""} | fields))
    monkeypatch.setattr(subprocess, "run", lambda *_args, **_kwargs: child)


def test_the_last_line_of_the_probe_names_the_driver(monkeypatch):
    answer(monkeypatch, stdout="noise\nvtkEGLRenderWindow, llvmpipe\n")
    assert opengl.offscreen_opengl() == "vtkEGLRenderWindow, llvmpipe"


@pytest.mark.parametrize(("fields", "reason"), [
    ({"returncode": -11}, "the probe died of signal 11"),
    ({"returncode": 0}, "the probe failed"),
    ({"returncode": 1, "stderr": "Traceback\nlibEGL.so.1: cannot open"}, "libEGL.so.1: cannot open"),
])  # fmt: skip
def test_a_machine_without_opengl_is_told_what_to_install(monkeypatch, fields, reason):
    answer(monkeypatch, **fields)
    with pytest.raises(DeviceError) as caught:
        VtkRenderer(ball(8), Appearance())
    assert str(caught.value) == f"offscreen OpenGL: {reason}; {opengl.ADVICE}"
    monkeypatch.setattr(subprocess, "run", Mock(side_effect=subprocess.TimeoutExpired("probe", 60)))
    with pytest.raises(DeviceError, match="no answer within 60 s; install libegl1"):
        opengl.offscreen_opengl()


def test_the_probe_runs_nothing_of_the_folder(tmp_path, monkeypatch):
    (tmp_path / "ctypes.py").write_text("from pathlib import Path; Path('was-run').touch()")
    monkeypatch.chdir(tmp_path)
    with contextlib.suppress(DeviceError):  # where nothing renders
        opengl.offscreen_opengl()
    assert not (tmp_path / "was-run").exists()
