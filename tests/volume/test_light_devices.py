"""Light inside of volumes on every device, and by every instruction set, against definitions in float64."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy.ndimage import map_coordinates

from tests.raster.requirements import require_same_bits
from tests.refusals import refused
from tests.volume.light_columns import shares_of
from tests.volume.scenes import SHELLS, ball, lattice
from texgs.core.camera import orbit
from texgs.core.cuts import Box, Cuts, Plane
from texgs.core.light import Light
from texgs.raster import native
from texgs.raster.api import cut_range
from texgs.volume.caster import OUTPUTS, Caster
from texgs.volume.grid import Grid
from texgs.volume.light_cells import LightCells, NativeCells
from texgs.volume.matter import Matter
from texgs.volume.render import Appearance
from texgs.volume.transfer import TransferFunction

HALF, SIZE = (0.5, 0.35, 0.25), (19, 13, 10)  # of cells
KINDS = ("uint8", "int16", "float32", "float64")
THIN = TransferFunction(((20, 0.0), (45, 0.05), (60, 0.3), (99, 0.9)), ((20, 0.9, 0.4, 0.1),))
STEPS = TransferFunction(((0, 0.1), (30, 0.1), (30, 0.0), (70, 0.02)), ((0, 0.1, 0.4, 0.8),), channel=1)
CUTS = Cuts([Plane([1.0, 0.3, -0.2], 0.21), Plane([0.0, -1.0, 0.5], 0.17)], Box([-0.41] * 3, [0.33] * 3))
LOOK = Appearance(step=0.5, opacity_unit=0.04)
DIRECTIONS = (
    *((1, 0, 0), (0, 0, -2)),  # along axes
    *((1, 1, 1), (-1, 1, 0), (0, -3, 9)),  # across
    *((0.3, -0.5, 0.8), (-0.7, 0.2, 0.1), (0.2, 0.9, -0.4)),
)


def waves(kind):
    """Two channels of whole numbers from 0 to 100, with whole bricks of which nothing shows."""
    x, y, z = lattice(27, 22, 31)
    one = 50 + 45 * np.sin(5 * x + y * z) * np.cos(3 * z - y)
    other = 50 * (1 + x * np.cos(4 * y)).clip(0, 2)
    channels = [np.ascontiguousarray(np.round(each).astype(kind)) for each in (one, other)]
    if kind.startswith("float"):
        channels[0][14:17, 9:12, 16:19] = np.nan
    return Grid(channels[0], (1.0, 0.9, 0.6), others=(channels[1],))


def matter_of(grid, device, cuts=CUTS):
    return Matter(Caster(grid, LOOK, device), [THIN, STEPS], LOOK.opacity_unit, cuts, longest=19)


def everything(kind, device="cpu"):
    """All that is computed of light in a volume of some type, and what a cast makes of it."""
    grid, camera = waves(kind), orbit(-60, 20, 2, 30, 30, 25).to(device)
    light = Light("directional", 30, 40, shadows=0.8, occlusion=0.6, reach=0.2)
    matter = matter_of(grid, device)
    cells = matter.lit(light.direction(camera), light.reach)
    points = 1.1 * torch.rand(77, 3, generator=torch.Generator().manual_seed(0)) - 0.55
    normals = torch.tensor([plane.normal for plane in CUTS.half_spaces]).to(device)
    offsets = torch.tensor([plane.offset for plane in CUTS.half_spaces]).to(device)
    cut = cut_range(normals, offsets, camera)
    seen = Caster(grid, LOOK, device).cast(
        [THIN, STEPS], camera, light, OUTPUTS, depth_range=cut.depth_range, faces=cut, cells=cells
    )
    of_light = {"light": cells.light.float() / 255, "shares": cells.at(points.to(device))}
    return {"extinction": matter.extinction, **of_light, **vars(seen)}


@pytest.fixture(scope="module", params=KINDS)
def on_cpu(request):
    """A type of samples, and everything on the CPU, computed before another device takes its place."""
    return request.param, everything(request.param)


def test_devices_agree(on_cpu, device):
    kind, expected = on_cpu
    for name, value in everything(kind, device).items():
        step = 1.01 / 255 if name in ("light", "shares", "rgba") else 1e-3
        torch.testing.assert_close(value.cpu(), expected[name], rtol=1e-5, atol=step, msg=name)
        assert float((value.cpu() - expected[name]).abs().mean()) < 5e-5
    assert float(expected["rgba"][..., 3].mean()) > 0.1
    assert float((expected["light"] < 0.9).float().mean()) > 0.3


def test_any_number_of_threads_gives_the_same_bits():
    require_same_bits(everything, "uint8")


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("cuts", [Cuts(), CUTS], ids=["whole", "cut"])
def test_extinctions_are_means_over_places(kind, cuts, device):
    grid = waves(kind)
    for channel in (grid.values, *grid.others):
        np.nan_to_num(channel, copy=False)
    extinction = matter_of(grid, device, cuts).extinction[1:-1, 1:-1, 1:-1].cpu()
    half, dims, size = np.array(grid.aabb[1]), np.array(grid.dims), np.array(extinction.shape)[::-1]
    per_cell = np.ceil((dims - 1) / size).clip(2, 8).astype(int)
    shares = [(np.arange(n) + 0.5) / n for n in per_cell * size]  # of the box
    at = np.stack(np.meshgrid(*shares, indexing="ij"), axis=-1)  # [x, y, z, 3]
    through, places = 1.0, np.moveaxis(at * (dims - 1), -1, 0)[::-1]
    for values, tf in ((grid.values, THIN), (grid.others[0], STEPS)):
        opacity = tf(map_coordinates(values.astype(float), places, order=1))[..., 3]
        through = through * (1 - opacity)
    all_of_them = -np.log2(through) * (2 * half / size).min() / LOOK.opacity_unit
    for plane in cuts.half_spaces:
        all_of_them *= (2 * at - 1) * half @ plane.normal <= plane.offset
    blocks = all_of_them.reshape(*np.stack([size, per_cell], axis=1).ravel())
    expected = blocks.mean(axis=(1, 3, 5)).T
    assert (expected > 0.1).mean() > 0.1
    # a place beside the step of a function may be on its other side
    assert np.quantile(np.abs(extinction.numpy() - expected), 0.99) < 2e-5 * expected.max()
    np.testing.assert_allclose(extinction, expected, atol=0.02 * expected.max())


def clouds():
    """Extinctions [z, y, x] of cells, half of them 0."""
    random = np.random.default_rng(0)
    return 0.3 * random.random(SIZE[::-1]) * (random.random(SIZE[::-1]) < 0.5)


def swept(name, extinction, *arguments, size=SIZE, device):
    """Return what a sweep of the library writes, beside 7 for what it must leave as it was."""
    light = torch.full((*size[::-1], 2), 7, dtype=torch.uint8, device=device)
    given = torch.as_tensor(extinction).float().contiguous().to(device)
    native.call(name, NativeCells(size, HALF), given, *arguments, light, device=device)
    return light.cpu().numpy()


@pytest.mark.parametrize("to_light", DIRECTIONS)
def test_a_light_goes_along_columns(to_light, device):
    extinction = clouds()
    light = swept("texgs_transmittance", extinction, torch.tensor(to_light).float(), device=device)
    expected = 255 * shares_of(extinction, HALF, to_light)
    np.testing.assert_allclose(light[..., 0], expected, atol=0.51)
    assert (light[..., 1] == 7).all()
    assert expected.min() < 200


@pytest.mark.parametrize("reach", [0.01, 0.2, 5.0])
def test_openness_is_twice_the_mean_of_lights_nearby(reach, device):
    extinction = 4 * clouds()
    unit = torch.nn.functional.normalize(torch.tensor(DIRECTIONS).float(), dim=1)
    light = swept("texgs_openness", extinction, len(unit), unit, reach, device=device)
    shares = [shares_of(extinction, HALF, each, reach) for each in unit.double().numpy()]
    np.testing.assert_allclose(light[..., 1], 255 * (2 * np.mean(shares, axis=0)).clip(0, 1), atol=0.51)
    assert (light[..., 0] == 7).all()


@pytest.mark.parametrize("size", [(10, 10, 10), (20, 14, 10), (10, 7, 5), (2, 2, 2), (3, 40, 11)])
def test_where_no_matter_is_all_light_arrives(size, device):
    """Also where columns go across a whole number of cells, and rounding makes that a little more."""
    empty = torch.zeros(size[::-1])
    for to_light in [(9, 0, -3), (-19, 0, -14), (-9, 0, -6), (0, -1, 9), (2, -5, 1), (-1, -1, 1)]:
        light = swept("texgs_transmittance", empty, torch.tensor(to_light).float(), size=size, device=device)
        assert (light[..., 0] == 255).all(), to_light


@given(*[st.integers(-20, 20)] * 3)
def test_no_direction_leaves_a_place_without_light(x, y, z):
    if x or y or z:
        empty, to_light = torch.zeros(10, 14, 20), torch.tensor([x, y, z]).float()
        light = swept("texgs_transmittance", empty, to_light, size=(20, 14, 10), device=torch.device("cpu"))
        assert (light[..., 0] == 255).all()


def test_lookups_are_linear_between_centres(device):
    light = torch.randint(256, (*SIZE[::-1], 2), generator=torch.Generator().manual_seed(0)).byte()
    points = 2.4 * torch.rand(501, 3, generator=torch.Generator().manual_seed(1)) - 1.2
    points = points * torch.tensor(HALF)
    shares = LightCells(light.to(device), HALF).at(points.to(device)).cpu()
    at = (points.double().numpy() / HALF + 1) / 2 * SIZE - 0.5
    for i in range(2):
        expected = map_coordinates(light[..., i].double().numpy(), at.T[::-1], order=1, mode="nearest")
        np.testing.assert_allclose(shares[:, i], expected / 255, atol=1e-5)


def test_a_cast_takes_shares_as_factors_of_its_lights(device):
    lamp, sky, camera = 0.2, 0.6, orbit(-60, 20, 2.5, 30, 30, 25)
    light = Light("directional", 30, 40, shadows=0.7, occlusion=0.5)
    left, open_sky = 1 - 0.7 * (1 - lamp), 1 - 0.5 * (1 - sky)
    bytes_ = torch.tensor([round(255 * lamp), round(255 * sky)]).byte().expand(4, 2, 3, 2)
    cells = LightCells(bytes_.contiguous().to(device), (0.5,) * 3)
    look = Appearance()
    dark = Appearance(
        ambient=look.ambient * open_sky, diffuse=look.diffuse * left, specular=look.specular * left
    )
    seen = Caster(ball(24), look, device).cast(SHELLS, camera, light, cells=cells).rgba
    expected = Caster(ball(24), dark, device).cast(SHELLS, camera, light).rgba
    torch.testing.assert_close(seen, expected, rtol=0, atol=2e-6)
    assert float(expected[..., 3].max()) > 0.5


def test_samples_see_the_light_before_their_surface(device):
    """Of shares that grow across a wall and before it, those of places on the viewer's side are seen."""
    x, _, _ = lattice(33, 33, 33)
    wall = TransferFunction(((0.3, 0.0), (0.302, 1.0), (1, 1.0)), ((0, 1, 1, 1),))  # behind x = -0.15
    camera = orbit(15, 10, 2.5, 15, 30, 25)  # whose rays meet it from the side of larger x
    look = Appearance(ambient=1, diffuse=0, specular=0, step=0.05, opacity_unit=0.001)
    centres = [(np.arange(n) + 0.5) / n - 0.5 for n in (8, 9, 10)]
    places = np.stack(np.meshgrid(*centres, indexing="ij"), axis=-1)  # [x, y, z, 3]
    grows = np.array([0.6, 0.3, -0.2])
    sky = np.round(255 * (0.5 + places @ grows)).astype(np.uint8).T
    shares = torch.from_numpy(np.stack([0 * sky, sky], axis=-1)).contiguous().to(device)
    cells = LightCells(shares, (0.5,) * 3)
    light = Light("headlight", occlusion=1.0)
    seen = Caster(Grid(-x), look, device).cast(wall, camera, light, cells=cells).rgba.cpu()
    rays, position = camera.rays().double().numpy(), camera.position.double().numpy()
    hit = position + (-0.15 - position[0]) / rays[..., :1] * rays
    before = hit + np.array([cells.outset, 0, 0])
    inner = np.abs(hit[..., 1:]).max(axis=-1) < 0.4
    assert inner.sum() > 300
    np.testing.assert_allclose(seen[inner][:, 0], (0.5 + before @ grows)[inner], atol=0.006)


@pytest.mark.parametrize(("name", "arguments", "message"), [
    ("texgs_transmittance", (torch.zeros(3),), "light: expected a direction"),
    ("texgs_openness", (0, torch.zeros(0, 3), 0.2), "light: expected directions and a reach above 0"),
    ("texgs_openness", (1, torch.ones(1, 3), 0.0), "light: expected directions and a reach above 0"),
])  # fmt: skip
def test_lights_that_are_none_are_refused(name, arguments, message, device):
    refused(lambda: swept(name, clouds(), *arguments, device=device), message)


@pytest.mark.parametrize("size", [(1, 2, 2), (2, 257, 2)])
def test_sizes_beyond_the_limits_are_refused(size, device):
    arguments = "texgs_transmittance", torch.zeros(size[::-1]), torch.ones(3)
    refused(
        lambda: swept(*arguments, size=size, device=device), "light: expected 2 to 256 cells along an axis"
    )


def test_more_planes_than_cuts_have_are_refused(device):
    caster, extinction = Caster(ball(8), LOOK, device), torch.zeros(2, 2, 2, device=device)
    shown, cells = caster.functions([SHELLS])[0], NativeCells((2, 2, 2), HALF)
    given = *shown, 0.1, torch.zeros(13, 4), 13, cells, extinction
    refused(lambda: native.call("texgs_extinction", *given, device=device), "planes: expected 12 at most")
