import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.lib.stride_tricks import sliding_window_view

from tests.volume.functions import functions
from tests.volume.march import march
from tests.volume.scenes import SHELLS, SPECK, ball, constant, lattice, over_white, psnr, specks
from tests.volume.vtk_caster import VtkCaster
from texgs.core.camera import Camera, intrinsics, look_at, orbit
from texgs.core.errors import ArgumentError
from texgs.core.light import HEADLIGHT, Light
from texgs.volume.caster import OUTPUTS, TYPES, Cast, Caster, points_of
from texgs.volume.grid import Grid
from texgs.volume.render import Appearance
from texgs.volume.transfer import TransferFunction, left_limit, right_limit


def render(grid, tf, camera, light=HEADLIGHT, **appearance):
    return Caster(grid, Appearance(**appearance)).render(tf, camera, light)


@pytest.mark.parametrize(("width", "height"), [(160, 160), (260, 120), (160, 240)])
def test_what_is_at_a_place_appears_where_the_camera_projects_it(width, height):
    places = [(4, 5, 6), (28, 5, 33), (16, 12, 20), (5, 20, 34), (28, 19, 5)]
    values = np.zeros((40, 25, 33), np.float32)
    for x, y, z in places:
        values[z, y, x] = 1
    grid = Grid(values, (1.0, 1.5, 0.8))
    voxel = np.array(grid.spacing) * grid.scale
    world = np.array(grid.aabb[0]) + voxel * np.array(places)  # [5, 3]
    mapper = Caster(grid, Appearance(opacity_unit=0.02))
    tf = TransferFunction(((0, 0), (1, 0.3)), ((0, 1, 1, 1),))
    rows, columns = np.mgrid[:height, :width] + 0.5
    errors = []
    for azimuth, polar in [(-90, 0), (-60, 25), (20, -40), (150, 60), (-90, 90)]:
        camera = orbit(azimuth, polar, 2.5 * max(1, height / width), 34, width, height)
        alpha = mapper.render(tf, camera, HEADLIGHT)[..., 3]
        for u, v in camera.project(torch.from_numpy(world))[0].numpy():
            near = alpha * ((columns - u) ** 2 + (rows - v) ** 2 < (0.04 * height) ** 2)
            errors.append(((near * columns).sum() / near.sum() - u, (near * rows).sum() / near.sum() - v))
    assert np.abs(errors).max() < 0.2
    assert np.abs(np.mean(errors, axis=0)).max() < 0.05  # no half pixel


def test_nothing_in_sight_is_zero():
    viewmat = look_at(torch.tensor([0.0, 0.0, 3.0]), torch.tensor([0.0, 0.0, 6.0]))
    away = Camera(viewmat, intrinsics(30, 20, 10), 20, 10)
    mapper = Caster(ball(16), Appearance())
    assert mapper.render(SHELLS, orbit(0, 0, 3, 30, 20, 10), HEADLIGHT).any()
    picture = mapper.render(SHELLS, away, HEADLIGHT)
    assert picture.shape == (10, 20, 4)
    assert not picture.any()


@pytest.mark.parametrize(("azimuth", "polar", "size"), [(-90, 0, 61), (0, 3, 60), (40, -10, 100)])
def test_rays_parallel_to_a_side_and_at_the_border_go_all_the_way(azimuth, polar, size):
    x, y, _ = lattice(33, 33, 33)
    camera = orbit(azimuth, polar, 1.5, 12, size, size)  # the volume fills the view
    look = Appearance(step=0.125, opacity_unit=0.02)
    alpha = Caster(Grid(x + 0.3 * y), look).render(constant(0.01), camera, HEADLIGHT)[..., 3]
    rays = camera.rays().double().numpy()
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    rays[np.abs(rays) < 1e-9] = 1e-9
    sides = (np.array([-0.5, 0.5])[:, None, None, None] - camera.position.double().numpy()) / rays
    length = (sides.max(axis=0).min(axis=-1) - sides.min(axis=0).max(axis=-1)).clip(0)
    np.testing.assert_allclose(alpha, 1 - 0.99 ** (length / 0.02), atol=0.015)


def test_pictures_are_the_same_bits_with_any_number_of_threads_and_every_time():
    camera, light = orbit(-60, 20, 2, 34, 64, 48), Light("directional", 30, 40)
    caster, threads = Caster(ball(), Appearance()), torch.get_num_threads()
    first = caster.render(SHELLS, camera, light)
    caster.render(SHELLS, orbit(10, -30, 1.5, 40, 40, 70), HEADLIGHT)  # leaves nothing behind
    for count in (1, 2, 5):
        torch.set_num_threads(count)
        np.testing.assert_array_equal(caster.render(SHELLS, camera, light), first)
    torch.set_num_threads(threads)


def test_a_camera_inside_sees_what_is_before_it():
    x, _, _ = lattice(33, 33, 33)
    position = torch.tensor([0.0, 0.0, 0.2])
    inside = Camera(look_at(position, torch.zeros(3)), intrinsics(20, 15, 15), 15, 15)
    alpha = render(Grid(x), constant(0.05), inside, opacity_unit=0.05)[7, 7, 3]
    assert alpha == pytest.approx(1 - 0.95 ** (0.7 / 0.05), abs=0.002)


@pytest.mark.parametrize("dims", [(32, 32, 32), (3, 9, 14), (2, 2, 2), (5, 2, 3)])
@pytest.mark.parametrize("dtype", [*TYPES, "bool", ">u2", ">f4"])
def test_every_type_of_samples_looks_the_same(dtype, dims, device):
    """A slope of whole numbers, from -60 to 60, or 0 to 120 where there is no sign."""
    x, y, z = lattice(*dims)
    low, high = {"b": (0, 1), "u": (0, 120)}.get(np.dtype(dtype).kind, (-60, 60))
    levels = np.round(low + (high - low) * (0.5 + 0.3 * x + 0.15 * y + 0.05 * z))
    half, most = (low + f * (high - low) for f in (0.5, 0.8))
    tf = TransferFunction(
        ((low, 0), (half, 0.3), (most, 0.6), (high, 0.9)), ((half, 0.8, 0.4, 0.2), (high, 0.1, 0.2, 0.9))
    )
    camera, light = orbit(-60, 20, 2, 34, 20, 20), Light("directional", 30, 40)
    expected, image = (
        Caster(grid, Appearance(), device).render(tf, camera, light)
        for grid in (Grid(levels), Grid(levels.astype(dtype)))
    )
    assert (expected[..., 3] > 0.1).any()
    np.testing.assert_array_equal(image, expected)


STEPS = TransferFunction(
    ((0.3, 0.1), (0.5, 0.1), (0.5, 0.6), (0.9, 0.6)), ((0.4, 1, 0, 0), (0.6, 0, 1, 0), (0.6, 0, 0, 1))
)


def wavy(points):
    """A transfer function of so many points, so that tables of any length are searched."""
    values = np.linspace(0.1, 0.9, points)
    return TransferFunction(
        tuple((v, 0.05 + 0.04 * np.sin(12 * v)) for v in values),
        tuple((v, 0.5 + 0.4 * np.sin(9 * v), v, 1 - v) for v in values[:-1] + 1e-3),
    )


@pytest.mark.parametrize("spacing", [(1.0, 1.0, 1.0), (1.0, 0.6, 1.7)])
@pytest.mark.parametrize("light", [HEADLIGHT, Light("directional", 30, 40)])
@pytest.mark.parametrize("step", [0.25, 0.5, 1.5])  # the last: each sample in another cell
def test_it_is_what_marching_in_torch_sees(step, light, spacing, device):
    grid, look = Grid(ball(40).values, spacing), Appearance(step=step)
    camera = orbit(-60, 20, 2.5, 30, 60, 50)
    expected = march(grid, SHELLS, camera, look, light)
    cast = Caster(grid, look, device).cast(SHELLS, camera, light, OUTPUTS)
    planes = Cast(*(plane.cpu() for plane in (cast.rgba, cast.depth, cast.median, cast.normal)))
    rgba = torch.cat([expected.color, expected.alpha[..., None]], -1).numpy()
    np.testing.assert_allclose(planes.rgba, rgba, atol=0.0015)  # light that is left at an end
    assert psnr(planes.rgba.numpy(), rgba) > 70
    seen = expected.alpha > 0.01
    np.testing.assert_allclose(planes.depth[seen], expected.depth[seen], atol=1e-3)
    np.testing.assert_allclose(planes.normal[seen], expected.normal[seen], atol=5e-3)
    assert not planes.depth[expected.alpha == 0].any()


@pytest.mark.parametrize("dtype", TYPES)
@given(tf=functions(), dims=st.tuples(*[st.integers(2, 10)] * 3), seed=st.integers(0, 99))
def test_cells_are_those_with_a_value_that_shows(tf, dims, seed, dtype):
    """Opacity at the extremes of a cell, between and just below them, is above 0: bricks are told so too."""
    assume(not any(0 < alpha < 1e-37 for _, alpha in tf.opacity))  # some processors take these for 0
    values = np.random.default_rng(seed).integers(-9, 10, dims).astype(np.float32)
    if dtype.startswith("u"):
        values = values.clip(0)
    caster = Caster(Grid(values.astype(dtype)), Appearance())
    *_, distance, words = caster._shown(tf, by_cell=True)
    bits = (words.numpy().view(np.uint32)[..., None] >> np.arange(32, dtype=np.uint32) & 1).reshape(
        -1, 4, 4, 4
    )
    corners = sliding_window_view(values, (2, 2, 2)).reshape(*(size - 1 for size in dims), 8)
    bricks = [-(-(size - 1) // 4) for size in dims]
    expected = np.zeros([4 * count for count in bricks], bool)
    expected[tuple(slice(size - 1) for size in dims)] = [
        [[shows_between(tf, cell.min(), cell.max()) for cell in row] for row in plane] for plane in corners
    ]
    of_bricks = expected.reshape(bricks[0], 4, bricks[1], 4, bricks[2], 4).transpose(0, 2, 4, 1, 3, 5)
    of_bricks = of_bricks.reshape(-1, 4, 4, 4)
    assert (bits == of_bricks).all()
    assert not of_bricks[distance.numpy()[: len(bits)] > 0].any()


def test_cells_change_nothing_but_the_order_of_sums(device):
    camera = orbit(-60, 20, 2.5, 30, 80, 70)
    for grid, tf in ((ball(40), SHELLS), (ball(7), STEPS), next((grid, SPECK) for grid, *_ in specks())):
        caster = Caster(grid, Appearance(), device)
        by_brick, by_cell = (
            caster.cast(tf, camera, HEADLIGHT, OUTPUTS, by_cell=know) for know in (False, True)
        )
        for one, other in zip(vars(by_brick).values(), vars(by_cell).values(), strict=True):
            torch.testing.assert_close(one, other, atol=1e-4, rtol=0)


def shows_between(tf, low, high):
    """Return whether a function has an opacity above 0 for some value from just below low to high."""
    ends = [value for value, _ in tf.opacity if low <= value <= high]
    at = np.array(sorted({low, high, *ends}), dtype=np.float64)
    before = at[(at > tf.opacity[0][0]) & (at <= tf.opacity[-1][0])]
    between = (at[1:] + at[:-1]) / 2
    inside = np.concatenate([at, between])
    inside = inside[(inside >= tf.opacity[0][0]) & (inside <= tf.opacity[-1][0])]
    table = np.float64(np.float32(tf.opacity))  # the library has single precision
    return any((right_limit(table, inside) > 0).ravel()) or any((left_limit(table, before) > 0).ravel())


@pytest.mark.parametrize("tf", [STEPS, *map(wavy, (8, 9, 16, 17, 150))])
def test_functions_of_any_points_and_steps_are_what_marching_sees(tf, device):
    grid, camera, look = ball(24), orbit(-60, 20, 2.5, 30, 30, 25), Appearance()
    expected = march(grid, tf, camera, look, HEADLIGHT)
    image = Caster(grid, look, device).render(tf, camera, HEADLIGHT)
    assert psnr(image, torch.cat([expected.color, expected.alpha[..., None]], -1).numpy()) > 70


def test_the_median_is_where_half_of_the_light_is_gone(device):
    x, _, _ = lattice(33, 33, 33)
    camera, look = orbit(-90, 0, 3, 10, 9, 9), Appearance(step=0.05, opacity_unit=0.05)
    rendered = Caster(Grid(x), look, device).cast(constant(0.1), camera, HEADLIGHT, ("median",))
    assert float(rendered.median[4, 4]) == pytest.approx(2.5 + 0.05 * np.log(0.5) / np.log(0.9), abs=2e-3)
    thin = Caster(Grid(x), look, device).cast(constant(0.01), camera, HEADLIGHT, ("median",))
    assert float(thin.median[4, 4]) == 0


@pytest.mark.parametrize("light", [HEADLIGHT, Light("directional", 30, 40)])
def test_vtk_sees_the_same(light):
    camera, look = orbit(-60, 20, 2.5, 30, 60, 50), Appearance(step=0.25)
    image = Caster(ball(64), look).render(SHELLS, camera, light)
    expected = VtkCaster(ball(64), look, 2).render(SHELLS, camera, light)
    assert psnr(over_white(image), over_white(expected)) > 48
    assert psnr(image[..., 3], expected[..., 3]) > 48


def test_a_value_at_the_end_of_a_function_is_visible(device):
    """All samples of a saturated volume are there: between equal values nothing is rounded away."""
    caster = Caster(Grid(np.full((20,) * 3, 255, np.uint8)), Appearance(opacity_unit=0.05, step=0.1), device)
    camera = orbit(*np.random.default_rng(0).uniform(-80, 80, 2), 2, 34, 40, 40)
    tfs = (TransferFunction(((200, 0.4), (end, 0.4)), ((200, 1, 1, 1),)) for end in (255, 300))
    np.testing.assert_array_equal(*(caster.render(tf, camera, HEADLIGHT) for tf in tfs))


def test_missing_values_are_transparent(device):
    values = ball(24).values.copy()
    values[3:9, 4:11, 5:12] = np.nan
    caster = Caster(Grid(values), Appearance(), device)
    away = values.copy()
    away[2:10, 3:12, 4:13] = -100  # with the cells around
    camera = orbit(-60, 20, 2, 34, 25, 25)
    tf = TransferFunction(((0.1, 0.5), (1, 0.9)), ((0, 1, 1, 1),))
    image = caster.render(tf, camera, HEADLIGHT)
    assert np.isfinite(image).all()
    assert bool(caster.cast(tf, camera, HEADLIGHT, ("normal",)).normal.isfinite().all())
    covered = Caster(Grid(np.nan_to_num(away, nan=-100)), Appearance(), device).render(tf, camera, HEADLIGHT)
    assert psnr(image[..., 3], covered[..., 3]) > 25
    nothing = Caster(Grid(np.full((4, 4, 4), np.nan)), Appearance(), device)
    assert not nothing.render(tf, camera, HEADLIGHT).any()


def test_thin_things_between_transparent_bricks_are_not_leapt_over(device):
    for grid, camera, depth in specks():
        look = Appearance(step=0.1, opacity_unit=0.001)
        seen = Caster(grid, look, device).cast(SPECK, camera, HEADLIGHT, ("depth",))
        assert seen.rgba[2, 2, 3] > 0.9
        assert float(seen.depth[2, 2]) == pytest.approx(depth, abs=0.03)


@given(functions())
def test_points_hold_the_function_at_every_value(tf):
    """What the libraries make of the points: of those before the last, the last that is not above a value."""
    points = points_of(tf).double().numpy()
    low, high = points[0, 0], points[-1, 0]
    values = np.array([x for x in np.arange(-64, 65) / 8 if low <= x <= high])
    first = (points[1:-1, 0][:, None] <= values).sum(axis=0)
    one, other = points[first], points[first + 1]
    width = other[:, :1] - one[:, :1]
    place = np.divide(values[:, None] - one[:, :1], width, where=width > 0, out=np.zeros_like(width))
    interpolated = one[:, 1:] + place * (other[:, 1:] - one[:, 1:])
    np.testing.assert_allclose(interpolated[:, [1, 2, 3, 0]], tf(values), atol=1e-5)


@pytest.mark.parametrize(("low", "high"), [(16777216, 16777217), (0, 1e39), (-3e38, 3e38), (0, 1e-39)])
def test_values_that_single_precision_cannot_tell_apart(low, high):
    tf = TransferFunction(((low, 0.5), (high, 0.5)), ((0, 1, 1, 1),))
    with pytest.raises(ArgumentError, match="expected values that differ in single precision, got"):
        points_of(tf)


def test_an_interval_may_be_narrower_than_single_precision_can_divide_by(device):
    tf = TransferFunction(((0, 0.5), (1e-39, 1), (1, 1)), ((0, 1, 1, 1),))
    picture = Caster(Grid(np.zeros((4, 4, 4), np.float32)), Appearance(), device).render(
        tf, orbit(0, 0, 3, 30, 8, 8), HEADLIGHT
    )
    assert picture[..., 3].max() > 0.99


def test_another_shading_is_that_of_a_caster_that_has_it(device):
    grid, dark, camera = ball(16), Appearance(ambient=0.1, specular=0.0), orbit(9, 9, 3, 30, 9, 9)
    image = Caster(grid, Appearance(), device).with_appearance(dark).render(SHELLS, camera, HEADLIGHT)
    np.testing.assert_array_equal(image, Caster(grid, dark, device).render(SHELLS, camera, HEADLIGHT))


SKEWED = torch.tensor([[9.0, 1.0, 4.0], [0.0, 9.0, 4.0], [0.0, 0.0, 1.0]])


@pytest.mark.parametrize(("change", "message"), [
    ({"values": np.zeros((4, 4, 4), np.float16)}, "expected samples of uint8, .* or bool, got float16"),
    ({"camera": {"K": SKEWED}}, r"K: expected no skew, got K\[0, 1\] = 1"),
    ({"outputs": ("alpha",)}, r"outputs: expected some of depth, median, normal, got \('alpha',\)"),
    ({"camera": {"viewmat": torch.full((4, 4), torch.nan)}}, "viewmat: expected finite values, got 16 NaN"),
    ({"step": 1e-7}, "step: expected at most 16777216 samples on a ray, got 1.21e[+]08"),
])  # fmt: skip
def test_mistakes_are_named(change, message):
    camera = replace(orbit(0, 0, 3, 30, 8, 8), **change.get("camera", {}))
    with pytest.raises(ArgumentError, match=message):
        Caster(Grid(change.get("values", ball(8).values)), Appearance(step=change.get("step", 0.25))).cast(
            SHELLS, camera, HEADLIGHT, change.get("outputs", ())
        )


@pytest.mark.large
def test_slices_may_be_larger_than_256_mib(tmp_path, device):
    """The last eighth of the rows shows, at the top, and nothing else."""
    rows = 1 << 14
    values = np.memmap(tmp_path / "values", np.uint8, "w+", shape=(2, rows + 8, rows))
    values[:, -rows // 8 :] = 200
    tf = TransferFunction(((100, 1), (255, 1)), ((0, 1, 1, 1),))
    caster = Caster(Grid(values, spacing=(1, 1, rows / 8)), Appearance(), device)
    camera = orbit(0, 0, 30, 2 * np.degrees(np.arctan(0.5 / 30)), 16, 64)
    alpha = caster.render(tf, camera, HEADLIGHT)[:, 8, 3]
    assert (alpha[1:7] > 0.99).all()
    assert not alpha[9:].any()


CHILD = """
import numpy as np, sys
from texgs.core.camera import orbit
from texgs.core.light import Light
from texgs.core.memory import peak_memory
from texgs.volume.render import Appearance
from texgs.volume.caster import Caster
from texgs.volume.grid import Grid
from texgs.volume.transfer import TransferFunction, left_limit, right_limit

tf = TransferFunction(((0, 0), (100, 0.5)), ((0, 1, 1, 1),))
camera, light = orbit(-60, 20, 2, 34, 60, 60), Light("headlight")
Caster(Grid(np.zeros((9, 9, 9), sys.argv[1])), Appearance()).render(tf, camera, light)
before, size = peak_memory(), 320
values = np.zeros((size, size, size), sys.argv[1])
values[...] = np.arange(size) // 4
assert Caster(Grid(values), Appearance()).render(tf, camera, light).any()
print((peak_memory() - before) / values.nbytes, *[name for name in sys.modules if name.startswith("vtk")])
"""


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
@pytest.mark.parametrize("dtype", ["float32", "uint8"])
def test_it_takes_little_more_memory_than_the_samples_and_no_vtk(dtype):
    command = [sys.executable, "-c", CHILD, dtype]
    child = subprocess.run(command, capture_output=True, text=True, check=False, timeout=100)
    assert child.returncode == 0, child.stderr
    share, *modules = child.stdout.split()
    assert modules == []
    assert float(share) < 1.3
