import subprocess
import sys

import pytest

from tests.real_data import real_data
from tests.volume.scenes import SHELLS, ball, over_white, psnr
from texgs.core.camera import orbit
from texgs.core.errors import DeviceError
from texgs.core.light import Light
from texgs.volume.appearance import Appearance
from texgs.volume.caster import Caster
from texgs.volume.grid import Grid
from texgs.volume.opengl import offscreen_opengl
from texgs.volume.transfer import TransferFunction
from texgs.volume.vtk_mapper import VtkMapper

LIGHTS = [Light("headlight"), Light("directional", 30, 40), Light("directional", -130, -20)]


@pytest.fixture(scope="module")
def opengl():
    pytest.importorskip("pyvista")
    try:
        offscreen_opengl()
    except DeviceError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="module")
def mappers(opengl):
    look = Appearance(step=0.5, opacity_unit=0.01)
    return VtkMapper(ball(), look), Caster(ball(), look)


@pytest.mark.parametrize("light", LIGHTS)
@pytest.mark.parametrize(("width", "height"), [(160, 160), (120, 80), (64, 100)])
def test_both_see_the_same_on_a_ball(mappers, light, width, height):
    camera = orbit(-60, 20, 2.5 * max(1, height / width), 30, width, height)
    vtk, own = (mapper.render(SHELLS, camera, light) for mapper in mappers)
    assert vtk.shape == (height, width, 4)
    assert vtk.dtype == own.dtype
    assert psnr(vtk[..., 3], own[..., 3]) > 50
    assert psnr(over_white(vtk), over_white(own)) > 15  # highlights differ


@pytest.mark.parametrize("light", LIGHTS[:2])
def test_both_see_the_same_on_a_real_volume(opengl, light):
    from texgs.volume.sources import open_source

    source = open_source(real_data("volumes/engine.vti"))
    grid = Grid(source.slices(0, source.dims[2]), source.spacing, source.origin)
    tf = TransferFunction(((130, 0), (160, 0.2), (200, 0.2), (201, 0.8), (255, 0.8)), ((0, 0.9, 0.5, 0.2),))
    look, camera = Appearance(step=0.5), orbit(-60, 20, 2.2, 30, 160, 160)
    vtk, own = (m.render(tf, camera, light) for m in (VtkMapper(grid, look), Caster(grid, look)))
    assert psnr(vtk[..., 3], own[..., 3]) > 37
    assert psnr(over_white(vtk), over_white(own)) > 15


def test_pictures_have_more_than_8_bits(mappers):
    picture = mappers[0].render(SHELLS, orbit(-60, 20, 2.5, 30, 60, 60), LIGHTS[0])
    assert len({float(alpha) for alpha in picture[..., 3].ravel()}) > 300


def test_a_view_does_not_depend_on_the_one_before(mappers):
    camera, vtk = orbit(-60, 20, 2.5, 30, 60, 60), mappers[0]
    first = vtk.render(SHELLS, camera, LIGHTS[1])
    other = TransferFunction(((0.1, 0), (0.4, 0.9)), ((0, 1, 0, 0),))
    assert psnr(vtk.render(other, orbit(20, -30, 3, 40, 90, 40), LIGHTS[0]).max(), first.max()) < 200
    assert (vtk.render(SHELLS, camera, LIGHTS[1]) == first).all()


def test_a_step_in_opacity_draws_no_warning_and_pyvista_is_imported_when_needed(opengl):
    program = """
import sys
from tests.volume.scenes import ball
from texgs.core.camera import orbit
from texgs.volume.appearance import Appearance
from texgs.volume.vtk_mapper import VtkMapper
from texgs.volume.transfer import TransferFunction
from texgs.core.light import Light
assert "pyvista" not in sys.modules
tf = TransferFunction(((0.5, 0.3), (0.7, 0.3), (0.7, 0.9), (1, 0.9)), ((0.5, 1, 0, 0), (0.7, 0, 1, 0)))
picture = VtkMapper(ball(24), Appearance(step=1)).render(tf, orbit(0, 0, 3, 30, 32, 32), Light("headlight"))
assert picture[16, 16, 3] > 0.9
"""
    child = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert child.returncode == 0, child.stderr
    assert child.stdout + child.stderr == ""


def test_a_machine_without_opengl_is_told_what_to_install(monkeypatch):
    died = subprocess.CompletedProcess([], returncode=-11, stdout="", stderr="")
    monkeypatch.setattr(subprocess, "run", lambda *_args, **_kwargs: died)
    with pytest.raises(DeviceError, match=r"^offscreen OpenGL: the probe died of signal 11; install libegl1"):
        VtkMapper(ball(8), Appearance())
