"""Light that goes through cells: closed forms, laws, and the definition for any cells and directions."""

import numpy as np
import pytest
import torch
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from torch.nn.functional import normalize

from tests.refusals import refused
from tests.volume.light_columns import shares_of
from texgs.raster import native
from texgs.volume.light_cells import OUTSET, LightCells, NativeCells
from texgs.volume.matter import even_directions

LEVEL = 1 / 255
examples = settings(
    max_examples=60,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],  # one device serves all examples of a test
)
DIRECTIONS = [(0, 0, 1), (0, -1, 0), (-1, 0, 0), (1, 1, 1), (-1, 1, 0), (0.3, -0.5, 0.2), (0.9, 0.1, -0.8)]


def shares(name, channel, extinction, half, *arguments, device):
    """Shares [Z, Y, X] in [0, 1], float64, by a function of the library; half the sides of the box [3]."""
    light = torch.full((*extinction.shape, 2), 255, dtype=torch.uint8, device=device)
    cells, device = NativeCells(tuple(extinction.shape[::-1]), tuple(half)), torch.device(device)
    matter = extinction.float().contiguous().to(device)
    native.call(name, cells, matter, *arguments, light, device=device)
    assert int(light[..., 1 - channel].min()) == 255  # the other is left as it is
    return light[..., channel].cpu().double() / 255


def lamp(extinction, half, to_light, device):
    to_light = torch.tensor(to_light, dtype=torch.float32)
    return shares("texgs_transmittance", 0, extinction, half, to_light, device=device)


def sky(extinction, half, reach, directions, device):
    arguments = (len(directions), directions.contiguous(), reach)
    return shares("texgs_openness", 1, extinction, half, *arguments, device=device)


def centres(size, half):
    """Centres [Z, Y, X, 3] of cells (x, y, z), world units."""
    axes = [h * ((torch.arange(n).double() + 0.5) * (2 / n) - 1) for n, h in zip(size, half, strict=True)]
    z, y, x = torch.meshgrid(*axes[::-1], indexing="ij")
    return torch.stack([x, y, z], dim=-1)


def edge_of(size, half):
    return min(2 * h / n for n, h in zip(size, half, strict=True))


@examples
@given(
    size=st.tuples(*3 * [st.integers(2, 6)]),
    sides=st.tuples(*3 * [st.floats(0.3, 1)]),
    to_light=st.tuples(*3 * [st.one_of(st.just(0.0), st.floats(-1, 1))]),
    seed=st.integers(0, 1000),
)
def test_light_is_what_each_column_lets_through(device, size, sides, to_light, seed):
    assume(np.linalg.norm(to_light) > 1e-3)
    rng = np.random.default_rng(seed)
    values = rng.choice([0.0, 0.1, 0.6, 2.0, 16.0], size[::-1]) * rng.random(size[::-1])
    matter = torch.from_numpy(values).float()
    expected = torch.from_numpy(shares_of(matter.double().numpy(), sides, np.float32(to_light)).copy())
    assert float((lamp(matter, sides, to_light, device) - expected).abs().max()) < 1.01 * LEVEL


@pytest.mark.parametrize("to_light", DIRECTIONS)
@pytest.mark.parametrize("sides", [(0.5, 0.5, 0.5), (0.5, 0.3, 0.4)])
def test_even_matter_lets_light_through_by_the_way_to_its_side(sides, to_light, device):
    size = tuple(round(192 * side) for side in sides)
    density = 6.0  # of a world unit
    matter = torch.full(size[::-1], density * edge_of(size, sides))
    along = normalize(torch.tensor(to_light).double(), dim=0)
    along = torch.where(along == 0, 1e-9, along)
    way = ((along.sign() * torch.tensor(sides) - centres(size, sides)) / along).amin(dim=-1)
    difference = (lamp(matter, sides, to_light, device) - torch.exp2(-density * way)).abs()
    assert float(difference.mean()) < LEVEL
    assert float((difference < 2 * LEVEL).double().mean()) > 0.94
    assert float(difference.max()) < 0.1  # along sides that light grazes: matter fades over a cell there


@pytest.mark.parametrize("to_light", DIRECTIONS)
def test_nothing_in_the_way_leaves_all_light(to_light, device):
    """Nor does what is behind."""
    matter = torch.zeros(20, 14, 17)
    assert float(lamp(matter, (0.4, 0.3, 0.5), to_light, device).min()) == 1
    place = centres((17, 14, 20), (0.4, 0.3, 0.5)) @ normalize(torch.tensor(to_light).double(), dim=0)
    edge = edge_of((17, 14, 20), (0.4, 0.3, 0.5))
    matter[place < -0.1] = 16
    assert float(lamp(matter, (0.4, 0.3, 0.5), to_light, device)[place > -0.1 + 4 * edge].min()) == 1


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("sign", [-1, 1])
def test_a_slab_casts_its_shadow_where_it_should(axis, sign, device):
    """Square to its faces all that is behind it gets the same; at 45 degrees more matter is in the way."""
    matter = torch.zeros(32, 32, 32)
    along = [0, 0, 0]
    along[axis] = sign
    part = matter.movedim(2 - axis, 0)
    part[14:18] = 0.5  # of an edge: a quarter of the light is left
    behind, before = (slice(0, 14), slice(18, 32))[::sign]
    light = lamp(matter, (0.5, 0.5, 0.5), along, device).movedim(2 - axis, 0)
    assert float((light[behind] - 0.25).abs().max()) < LEVEL
    assert float(light[before].min()) == 1
    inside = light[14:18] if sign < 0 else light[14:18].flip(0)
    expected = 2 ** -(0.5 * (torch.arange(4) + 0.5))[:, None, None]
    assert float((inside - expected).abs().max()) < LEVEL
    along[axis - 1] = 1
    light = lamp(matter, (0.5, 0.5, 0.5), along, device).movedim(2 - axis, 0)
    middle = light[behind][:, 14:18, 14:18][2:-2] if axis else light[behind].median()
    assert float((torch.as_tensor(middle).median() - 0.25 ** (2**0.5)).abs()) < 2 * LEVEL


@pytest.mark.parametrize("to_light", DIRECTIONS)
def test_behind_an_opaque_wall_is_no_light(to_light, device):
    """Of a ball: two cells inside of its shadow it is black, three outside it is bright."""
    size, half = (40, 36, 44), (0.4, 0.36, 0.44)
    to_light = torch.tensor(to_light).double() / np.linalg.norm(to_light)
    places = centres(size, half)
    matter = torch.zeros(size[::-1])
    matter[places.norm(dim=-1) < 0.15] = 16
    side = places - (places @ to_light)[..., None] * to_light
    light = lamp(matter, half, to_light.tolist(), device)
    behind = (places @ to_light < -0.1) & (side.norm(dim=-1) < 0.15 - 2 * 0.02)
    beside = (side.norm(dim=-1) > 0.15 + 3 * 0.02) | (places @ to_light > 0.15 + 3 * 0.02)
    assert behind.sum() > 100
    assert float(light[behind].max()) < 2 * LEVEL
    assert float(light[beside].min()) > 1 - 2 * LEVEL


def random_matter(seed, shape=(9, 7, 8)):
    values = torch.rand(shape, generator=torch.Generator().manual_seed(seed))
    return torch.where(values > 0.7, values, 0)


@examples
@given(seed=st.integers(0, 1000), to_light=st.tuples(*3 * [st.floats(-1, 1)]), axis=st.integers(0, 2))
def test_light_comes_alike_from_all_sides(seed, to_light, axis, device):
    """Mirrored matter gets mirrored light of a mirrored direction, and turned matter turned light."""
    assume(np.linalg.norm(to_light) > 1e-3)
    matter, half = random_matter(seed), (0.4, 0.35, 0.45)
    light = lamp(matter, half, to_light, device)
    mirrored = [x * (-1 if a == axis else 1) for a, x in enumerate(to_light)]
    found = lamp(matter.flip(2 - axis), half, mirrored, device).flip(2 - axis)
    assert float((found - light).abs().max()) < 1.01 * LEVEL
    ordered = sorted(map(abs, np.array(to_light) / np.array([0.4, 0.35, 0.45]) * (8, 7, 9)))
    assume(ordered[2] > 1.001 * ordered[1])  # else columns may go through other slices
    turned = lamp(matter.permute(1, 2, 0), (half[2], half[0], half[1]), (to_light[2], *to_light[:2]), device)
    assert float((turned.permute(2, 0, 1) - light).abs().max()) < 1.01 * LEVEL


@examples
@given(seed=st.integers(0, 1000), axis=st.integers(0, 2), sign=st.sampled_from([-1, 1]))
def test_light_only_fades_along_its_way(seed, axis, sign, device):
    direction = [0.0, 0.0, 0.0]
    direction[axis] = sign
    light = lamp(random_matter(seed), (0.4, 0.35, 0.45), direction, device).movedim(2 - axis, 0)
    steps = sign * light.diff(dim=0)  # towards the light
    assert float(steps.min()) >= 0
    assert float(steps.max()) > 0.1


@examples
@given(seed=st.integers(0, 1000), to_light=st.sampled_from(DIRECTIONS), more=st.floats(1, 4))
def test_more_matter_never_leaves_more_light(seed, to_light, more, device):
    matter = random_matter(seed)
    less = lamp(matter, (0.4, 0.35, 0.45), to_light, device)
    assert float((lamp(more * matter, (0.4, 0.35, 0.45), to_light, device) - less).max()) <= 0


def half_space(size=48):
    matter = torch.zeros(size, size, size)
    matter[: size // 2] = 16
    return matter


@pytest.mark.parametrize("count", [32, 128])
def test_half_of_all_directions_are_open_on_an_even_surface(count, device):
    """Above, more of them, in steps of a direction; deep inside there are none."""
    directions, reach = even_directions(count), 0.2
    open_ = sky(half_space(), (0.5, 0.5, 0.5), reach, directions, device)[:, 24, 24]
    height = (torch.arange(48) - 23.5) / 48
    free = height[:, None] + reach * directions[:, 2].double() > 0  # where rays end
    expected = (2 * free.double().mean(dim=1)).clamp_max(1)
    assert float(open_[2 : 24 - 10].max()) == 0
    assert float(open_[26:].min()) == 1
    above = height > 2 / 48
    assert float((open_ - expected)[above].abs().max()) < 2 / count


@pytest.mark.parametrize("walls", [2, 3])
def test_a_corner_of_walls_is_open_where_no_wall_is_in_reach(walls, device):
    """Two and a half cells from each of them; of two walls that is more than a quarter of all directions."""
    matter, directions, reach = half_space(64), even_directions(256), 0.2
    for axis in range(1, walls):
        matter.movedim(axis, 0)[:32] = 16
    free = (reach * directions[:, 3 - walls :] > -2.5 / 64).all(dim=1)
    open_ = sky(matter, (0.5, 0.5, 0.5), reach, directions, device)
    assert float(open_[34, 34, 34 if walls == 3 else 10]) == pytest.approx(
        2 * float(free.double().mean()), abs=0.05
    )
    assert float(open_[50, 50, 50]) == 1


def test_only_matter_within_reach_hides_the_sky(device):
    """A box of walls, twelve cells from the middle: reach decides, to a cell."""
    matter = torch.full((32, 32, 32), 16.0)
    matter[3:29, 3:29, 3:29] = 0
    inner = slice(15, 17)
    for reach, expected in ((9 / 32, 1), (23 / 32, 0)):
        open_ = sky(matter, (0.5, 0.5, 0.5), reach, even_directions(64), device)[inner, inner, inner]
        assert float((open_ - expected).abs().max()) == 0


@examples
@given(seed=st.integers(0, 1000))
def test_openness_without_an_end_is_the_mean_of_lamps(seed, device):
    matter, half, directions = 0.3 * random_matter(seed), (0.4, 0.35, 0.45), even_directions(9)
    lamps = [lamp(matter, half, each.tolist(), device) for each in directions]
    expected = (2 * torch.stack(lamps).mean(dim=0)).clamp_max(1)
    assert float((sky(matter, half, 2.0, directions, device) - expected).abs().max()) < 3 * LEVEL


def test_the_outset_is_so_many_of_the_shortest_edges():
    cells = LightCells(torch.zeros(10, 30, 20, 2, dtype=torch.uint8), (0.5, 0.5, 0.5))
    assert cells.size == (20, 30, 10)
    assert cells.outset == pytest.approx(OUTSET / 30)


@pytest.mark.parametrize(("arguments", "named"), [
    (((2, 2, 1), (0.5, 0.5, 0.5), (0, 0, 1)), "expected 2 to 256 cells along an axis"),
    (((2, 257, 2), (0.5, 0.5, 0.5), (0, 0, 1)), "expected 2 to 256 cells along an axis"),
    (((2, 2, 2), (0.5, 0.0, 0.5), (0, 0, 1)), "expected sides above 0"),
    (((2, 2, 2), (0.5, float("nan"), 0.5), (0, 0, 1)), "expected sides above 0"),
    (((2, 2, 2), (0.5, 0.5, 0.5), (0, 0, 0)), "expected a direction"),
    (((2, 2, 2), (0.5, 0.5, 0.5), (0, float("nan"), 1)), "expected a direction"),
    (((2, 2, 2), (0.5, 0.5, 0.5), (0, float("inf"), 1)), "expected a direction"),
])  # fmt: skip
def test_mistakes_are_named(arguments, named, device):
    size, half, to_light = arguments
    refused(lambda: lamp(torch.zeros(size), half, to_light, device), named)


@pytest.mark.parametrize("reach", [0.0, -1.0, float("nan")])
def test_a_reach_that_is_none_is_refused(reach, device):
    refused(lambda: sky(half_space(4), (0.5, 0.5, 0.5), reach, even_directions(8), device), "reach above 0")
    refused(
        lambda: sky(half_space(4), (0.5, 0.5, 0.5), 0.1, torch.zeros(0, 3), device), "expected directions"
    )
