import os
import subprocess
import sys

import numpy as np
import pytest
import torch
from torch.nn.functional import normalize

from tests.real_data import real_data
from tests.volume.scenes import SHELLS, ball, constant, lattice, over_white, psnr
from texgs.core.camera import Camera, intrinsics, look_at, orbit
from texgs.core.errors import NativeError
from texgs.core.light import Light
from texgs.volume.appearance import Appearance
from texgs.volume.cpu_mapper import CpuMapper
from texgs.volume.grid import Grid
from texgs.volume.transfer import TransferFunction

HEADLIGHT = Light("headlight")
QUANTUM = 1 / 32767  # of the mapper's numbers


def render(grid, tf, camera, light=HEADLIGHT, threads=2, **appearance):
    return CpuMapper(grid, Appearance(**appearance), threads).render(tf, camera, light)


def blinn_phong(color, normal, to_viewer, to_light, look):
    """One sample [3], written out once more."""
    n, v, light = (np.asarray(x, np.float64) / np.linalg.norm(x) for x in (normal, to_viewer, to_light))
    n = n if n @ v >= 0 else -n
    half = (light + v) / np.linalg.norm(light + v)
    specular = max(n @ half, 0) ** look.shininess if n @ light > 0 else 0
    lit = np.asarray(color) * (look.ambient + look.diffuse * max(n @ light, 0)) + look.specular * specular
    return np.clip(lit, 0, 1)


@pytest.mark.parametrize("step", [0.125, 0.5, 1.0])
@pytest.mark.parametrize("opacity_unit", [0.02, 0.2])
@pytest.mark.parametrize("opacity", [0.01, 0.05, 0.5])
def test_alpha_of_a_slab_follows_the_opacity_unit_and_not_the_step(opacity, opacity_unit, step):
    x, _, _ = lattice(33, 33, 33)
    camera = orbit(-90, 0, 40, 2.0, 9, 9)
    picture = render(Grid(x), constant(opacity), camera, step=step, opacity_unit=opacity_unit)
    of_a_sample = 1 - (1 - opacity) ** (step / 32 / opacity_unit)
    least, most = (1 - (1 - opacity) ** (length / opacity_unit) for length in (1, 1 + step / 32))
    # Opacities of samples and transmittances are cut to 15 bits, and rays end where they are nearly opaque.
    rounding = (1 - least) * np.log1p(-opacity) / -opacity_unit * QUANTUM / of_a_sample
    tolerance = rounding + 32 / step * 0.25 * QUANTUM + 0.0005 + 0.008 * (least > 0.99)
    assert least - tolerance < picture[4, 4, 3] < most + tolerance


@pytest.mark.parametrize("light", [HEADLIGHT, *(Light("directional", *angles) for angles in
                                                [(-90, 0), (-60, 35), (-150, -20), (90, 10)])])  # fmt: skip
@pytest.mark.parametrize(("azimuth", "polar"), [(-90, 0), (-75, 10), (-110, -25), (-50, 35)])
def test_a_flat_face_has_the_intensity_of_blinn_phong(azimuth, polar, light):
    _, _, z = lattice(17, 17, 17)  # opaque for z < 0: the normal is z everywhere
    color, look = (0.7, 0.4, 0.2), Appearance(step=0.25)
    tf = TransferFunction(((-2, 1), (0, 1)), ((0, *color),))
    camera = orbit(azimuth, polar, 3, 20, 33, 33)
    picture = render(Grid(-z.copy()[::-1]), tf, camera, light)
    to_viewer = -camera.viewmat[2, :3].numpy()
    to_light = to_viewer if light.kind == "headlight" else light.direction(camera).numpy()
    expected = blinn_phong(color, (0, 0, 1), to_viewer, to_light, look)
    centre = picture[16, 16]
    # Normals have 16 bits: the highlight, a power of 20, is off by a little more than the rest.
    np.testing.assert_allclose(centre[:3] / centre[3], expected, atol=0.008)


@pytest.mark.parametrize("light", [HEADLIGHT, Light("directional", -60, 35), Light("directional", 150, 10)])
def test_a_ball_has_the_intensity_of_blinn_phong(light):
    color, look, radius = (0.3, 0.6, 0.4), Appearance(), 0.35  # world units: 0.7 of the half side 0.5
    tf = TransferFunction(((0.3, 1), (1, 1)), ((0, *color),))
    camera = orbit(-70, 20, 4, 16, 81, 81)
    picture = render(ball(64), tf, camera, light, opacity_unit=0.002)
    to_viewer = -camera.viewmat[2, :3].double()
    to_light = to_viewer if light.kind == "headlight" else light.direction(camera)
    origin = camera.position.double()
    v, u = np.mgrid[4:81:6, 4:81:6]
    for y, x in zip(v.ravel(), u.ravel(), strict=True):
        pixel = torch.tensor([x + 0.5, y + 0.5, 1.0], dtype=torch.float64)
        ray = normalize(
            camera.viewmat[:3, :3].double().T @ torch.linalg.solve(camera.K.double(), pixel), dim=0
        )
        root = (origin @ ray) ** 2 - origin @ origin + radius**2
        if root < 0.15 * radius**2:  # at the rim a sample's distance turns the normal
            continue
        normal = origin + (-(origin @ ray) - root.sqrt()) * ray
        expected = blinn_phong(color, normal, to_viewer, to_light, look)
        np.testing.assert_allclose(picture[y, x, :3] / picture[y, x, 3], expected, atol=0.02)


@pytest.mark.parametrize(("width", "height"), [(160, 160), (260, 120), (160, 240)])
def test_what_is_at_a_place_appears_where_the_camera_projects_it(width, height):
    places = [(4, 5, 6), (28, 5, 33), (16, 12, 20), (5, 20, 34), (28, 19, 5)]
    values = np.zeros((40, 25, 33), np.float32)
    for x, y, z in places:
        values[z, y, x] = 1
    grid = Grid(values, (1.0, 1.5, 0.8))
    voxel = np.array(grid.spacing) * grid.scale
    world = np.array(grid.aabb[0]) + voxel * np.array(places)  # [5, 3]
    mapper = CpuMapper(grid, Appearance(opacity_unit=0.02), 2)
    tf = TransferFunction(((0, 0), (1, 0.3)), ((0, 1, 1, 1),))
    rows, columns = np.mgrid[:height, :width] + 0.5
    errors = []
    for azimuth, polar in [(-90, 0), (-60, 25), (20, -40), (150, 60), (-90, 90)]:
        camera = orbit(azimuth, polar, 2.5 * max(1, height / width), 34, width, height)
        alpha = mapper.render(tf, camera, HEADLIGHT)[..., 3]
        viewmat, K = camera.viewmat.double().numpy(), camera.K.double().numpy()
        projected = (world @ viewmat[:3, :3].T + viewmat[:3, 3]) @ K.T
        for u, v in projected[:, :2] / projected[:, 2:]:
            near = alpha * ((columns - u) ** 2 + (rows - v) ** 2 < (0.04 * height) ** 2)
            errors.append(((near * columns).sum() / near.sum() - u, (near * rows).sum() / near.sum() - v))
    assert np.abs(errors).max() < 0.2
    assert np.abs(np.mean(errors, axis=0)).max() < 0.05  # no half pixel


def test_pixels_are_premultiplied_to_the_edge():
    # No highlight, so that the colour inside is at most the material's.
    camera = orbit(-60, 20, 2, 34, 100, 80)
    tf = TransferFunction(((0.3, 0), (0.5, 0.2), (1, 0.9)), ((0, 0.8, 0.4, 0.2),))
    picture = render(ball(), tf, camera, ambient=1.0, diffuse=0.0, specular=0.0)
    assert (picture[..., :3] <= picture[..., 3:] + 0.006).all()
    edge = (picture[..., 3] > 0.05) & (picture[..., 3] < 0.9)
    assert edge.sum() > 50
    straight = picture[edge, :3] / picture[edge, 3:]
    np.testing.assert_allclose(straight, np.broadcast_to([0.8, 0.4, 0.2], straight.shape), atol=0.02)


def test_nothing_in_sight_is_zero():
    viewmat = look_at(torch.tensor([0.0, 0.0, 3.0]), torch.tensor([0.0, 0.0, 6.0]))
    away = Camera(viewmat, intrinsics(30, 20, 10), 20, 10)
    mapper = CpuMapper(ball(16), Appearance(), 1)
    assert mapper.render(SHELLS, orbit(0, 0, 3, 30, 20, 10), HEADLIGHT).any()
    picture = mapper.render(SHELLS, away, HEADLIGHT)
    assert picture.shape == (10, 20, 4)
    assert not picture.any()


@pytest.mark.parametrize(("azimuth", "polar", "size"), [(-90, 0, 61), (0, 3, 60), (40, -10, 100)])
def test_rays_parallel_to_a_side_and_at_the_border_go_all_the_way(azimuth, polar, size):
    x, y, _ = lattice(33, 33, 33)
    camera = orbit(azimuth, polar, 1.5, 12, size, size)  # the volume fills the view
    look = Appearance(step=0.125, opacity_unit=0.02)
    alpha = CpuMapper(Grid(x + 0.3 * y), look, 2).render(constant(0.01), camera, HEADLIGHT)[..., 3]
    v, u = np.mgrid[:size, :size] + 0.5
    K, viewmat = camera.K.double().numpy(), camera.viewmat.double().numpy()
    rays = np.stack([u, v, np.ones_like(u)], axis=-1) @ np.linalg.inv(K).T @ viewmat[:3, :3]
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    rays[np.abs(rays) < 1e-9] = 1e-9
    sides = (np.array([-0.5, 0.5])[:, None, None, None] - camera.position.double().numpy()) / rays
    length = (sides.max(axis=0).min(axis=-1) - sides.min(axis=0).max(axis=-1)).clip(0)
    np.testing.assert_allclose(alpha, 1 - 0.99 ** (length / 0.02), atol=0.015)


def test_pictures_are_the_same_bits_with_any_number_of_threads_and_every_time():
    camera, light = orbit(-60, 20, 2, 34, 64, 48), Light("directional", 30, 40)
    one = CpuMapper(ball(), Appearance(), 1)
    first = one.render(SHELLS, camera, light)
    one.render(SHELLS, orbit(10, -30, 1.5, 40, 40, 70), HEADLIGHT)  # leaves nothing behind
    np.testing.assert_array_equal(one.render(SHELLS, camera, light), first)
    np.testing.assert_array_equal(render(ball(), SHELLS, camera, light, threads=2), first)


def test_a_camera_inside_sees_what_is_before_it():
    x, _, _ = lattice(33, 33, 33)
    position = torch.tensor([0.0, 0.0, 0.2])
    inside = Camera(look_at(position, torch.zeros(3)), intrinsics(20, 15, 15), 15, 15)
    alpha = render(Grid(x), constant(0.05), inside, opacity_unit=0.05)[7, 7, 3]
    assert alpha == pytest.approx(1 - 0.95 ** (0.7 / 0.05), abs=0.01)


@pytest.mark.parametrize("dtype", ["uint8", "int8", "uint16", "int16"])
def test_integers_and_floats_of_one_volume_look_the_same(dtype):
    levels = np.round(ball().values.clip(0, 1) * 120)
    grid = Grid(levels.astype(dtype))
    tf = TransferFunction(((36, 0), (60, 0.3), (96, 0.6)), ((36, 0.8, 0.4, 0.2), (72, 0.1, 0.2, 0.9)))
    camera = orbit(-60, 20, 2, 34, 80, 80)
    pictures = [over_white(render(volume, tf, camera)) for volume in (grid, Grid(levels.astype(np.float32)))]
    assert psnr(*pictures) > (50 if np.dtype(dtype).itemsize == 1 else 30)


def test_a_step_in_opacity_is_a_sharp_edge():
    x, _, _ = lattice(65, 9, 9)  # values -1 to 1 along 64 voxels
    tf = TransferFunction(((-0.5, 0.9), (0.25, 0.9)), ((0, 1, 1, 1),))
    picture = render(Grid(x), tf, orbit(-90, 0, 60, 1.0, 129, 33), opacity_unit=0.01)
    visible = picture[16, :, 3] > 0.5
    left, right = np.flatnonzero(visible)[[0, -1]]
    pixel = 60 * np.tan(np.radians(0.5)) * 2 / 33  # world units
    assert (left - 64) * pixel == pytest.approx(-0.25, abs=1.5 * pixel)
    assert (right - 64) * pixel == pytest.approx(0.125, abs=1.5 * pixel)


@pytest.mark.parametrize(("light", "bright", "dark"), [
    (Light("directional", 0, 0), (40, 60), (40, 20)),  # from +x: right, seen from +z
    (Light("directional", 180, 0), (40, 20), (40, 60)),
    (Light("directional", 0, 90), (20, 40), (60, 40)),  # from above
    (Light("directional", 0, -90), (60, 40), (20, 40)),
])  # fmt: skip
def test_light_comes_from_its_direction(light, bright, dark):
    tf = TransferFunction(((0.3, 0.9), (1, 0.9)), ((0, 0.5, 0.5, 0.5),))
    picture = render(ball(), tf, orbit(-90, 0, 3, 20, 81, 81), light)
    assert picture[bright][0] > picture[dark][0] + 0.2


def test_eight_bits_show_no_bands():
    x, y, z = lattice(32, 32, 32)
    levels = np.round(100 + 50 * (0.3 * x + 0.2 * y + z)).astype(np.uint8)
    tf = TransferFunction(((100, 0.5), (255, 0.5)), ((0, 0.8, 0.8, 0.8),))
    picture = render(Grid(levels), tf, orbit(-90, 0, 3, 14, 64, 64), specular=0.0)
    inner = picture[16:48, 16:48, 3]
    assert np.abs(np.diff(inner, axis=0)).max() < 0.02


CHILD = """
import numpy as np, sys
from texgs.core.camera import orbit
from texgs.core.memory import peak_memory
from texgs.volume.appearance import Appearance
from texgs.volume.cpu_mapper import CpuMapper
from texgs.volume.grid import Grid
from texgs.volume.transfer import TransferFunction
from texgs.core.light import Light

size = 192
values = np.zeros((size, size, size), sys.argv[1])
values[...] = np.arange(size) // 2
mapper = CpuMapper(Grid(values), Appearance(), 1)
tf = TransferFunction(((0, 0), (100, 0.5)), ((0, 1, 1, 1),))
assert mapper.render(tf, orbit(-60, 20, 2, 34, 60, 60), Light("headlight")).any()
with open("/proc/self/maps") as file:
    libraries = {line.split("/")[-1].strip() for line in file if "/" in line}
found = [name for name in libraries if name.startswith(("libGL", "libEGL", "libOSMesa", "libOpenGL"))]
print(peak_memory(), values.nbytes, *found)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
@pytest.mark.parametrize("dtype", ["float32", "uint8"])
def test_a_process_needs_no_opengl_and_little_memory(dtype):
    hidden = {"DISPLAY", "WAYLAND_DISPLAY"}
    environment = {name: value for name, value in os.environ.items() if name not in hidden}
    environment["VTK_DEFAULT_OPENGL_WINDOW"] = "nonsense"
    command = [sys.executable, "-c", CHILD, dtype]
    child = subprocess.run(command, env=environment, capture_output=True, text=True, check=False, timeout=100)
    assert child.returncode == 0, child.stderr
    assert child.stderr == ""
    peak, n_bytes, *libraries = child.stdout.split()
    assert libraries == []
    # 16 bits and a normal of 3 bytes for each sample of 8 bits.
    assert int(peak) < (2 if dtype == "float32" else 6) * int(n_bytes) + 500e6


def test_an_image_that_cannot_be_read_is_an_error(monkeypatch):
    mapper = CpuMapper(ball(16), Appearance(), 1)

    class Image:
        def GetImage(self):
            return "nothing"

    class Mapper:
        def __getattr__(self, _name):
            return lambda *_args: Image()

    monkeypatch.setattr(mapper, "_mapper", Mapper())
    with pytest.raises(NativeError, match=r"expected a pointer, got 'nothing'; install VTK 9\.4 or newer"):
        mapper.render(SHELLS, orbit(0, 0, 3, 30, 8, 8), HEADLIGHT)


def test_a_real_volume_is_seen_and_lit():
    from texgs.volume.sources import open_source

    source = open_source(real_data("volumes/fuel.nii.gz"))
    grid = Grid(source.slices(0, source.dims[2]), source.spacing, source.origin)
    tf = TransferFunction(((20, 0.0), (60, 0.3), (255, 0.6)), ((0, 0.9, 0.5, 0.2),))
    camera = orbit(-60, 20, 2, 34, 60, 60)
    picture = render(grid, tf, camera)
    assert 0.05 < (picture[..., 3] > 0.5).mean() < 0.6
    assert psnr(over_white(picture), over_white(render(grid, tf, camera, Light("directional", 90, 30)))) < 35
