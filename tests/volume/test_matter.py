"""What hides light: the mean extinction of cells, against means of places that are looked up one by one."""

import numpy as np
import pytest
import torch
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.refusals import refused
from tests.volume.functions import GREY, functions
from tests.volume.march import inside as inside_of_mask
from tests.volume.march import sample
from tests.volume.scenes import SHELLS, ball, constant, lattice
from texgs.core.cuts import Box, Cuts, Plane
from texgs.volume.caster import TYPES, Caster
from texgs.volume.grid import Grid
from texgs.volume.matter import Matter, even_directions
from texgs.volume.render import Appearance
from texgs.volume.transfer import TransferFunction

UNIT = 0.03  # of opacities, world units
MOST_PLACES, MOST_EXTINCTION = 8, 16.0  # in a cell along an axis; of a place
examples = settings(
    max_examples=30,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)


def matter_of(grid, tfs, longest, device="cpu", cuts=Cuts()):  # noqa: B008, it is frozen
    return Matter(Caster(grid, Appearance(), device), tfs, UNIT, cuts, longest)


def inside(matter):
    """Extinctions [Z, Y, X] of the cells in the box of the volume; those around it are empty."""
    inner = matter.extinction[1:-1, 1:-1, 1:-1].cpu()
    assert float(matter.extinction.double().sum()) == float(inner.double().sum())
    return inner


def brute_force(grid, tfs, size, cuts=None, unit=UNIT):
    """Mean extinctions [Z, Y, X] of cells (x, y, z), float64, over places as dense as samples or denser."""
    half = np.array(grid.aabb[1])
    places = [
        min(max(2, -(-(n - 1) // cells)), MOST_PLACES) for n, cells in zip(grid.dims, size, strict=True)
    ]
    axes = [(np.arange(n * k) + 0.5) / (n * k) * 2 - 1 for n, k in zip(size, places, strict=True)]
    z, y, x = np.meshgrid(*axes[::-1], indexing="ij")
    points = np.stack([x, y, z], axis=-1)
    total = np.zeros(x.shape)
    for tf in tfs:
        values = torch.from_numpy(grid.channel(tf.channel).values.astype(np.float64))
        opacity = tf(sample(values, torch.from_numpy(points)))[..., 3]
        opacity[~inside_of_mask(grid, tf, torch.from_numpy(points)).numpy()] = 0
        edge = (2 * half / size).min()
        with np.errstate(divide="ignore"):
            total -= np.log2(1 - opacity) * edge / unit
    total = np.minimum(total, MOST_EXTINCTION)
    for plane in cuts.half_spaces if cuts else ():
        total[(points * half) @ plane.normal > plane.offset] = 0
    (kx, ky, kz), (nx, ny, nz) = places, size
    return total.reshape(nz, kz, ny, ky, nx, kx).mean(axis=(1, 3, 5))


def require_close(matter, expected):
    """Require the same extinctions, but for places at a step, where single precision decides."""
    found = inside(matter).numpy()
    assert found.shape == expected.shape
    is_close = np.isclose(found, expected, rtol=2e-4, atol=2e-4)
    assert is_close.mean() > 0.99
    assert abs(found.mean() - expected.mean()) < 2e-3 * max(1, expected.mean())


RAMP = TransferFunction(((0.3, 0.0), (0.5, 0.3), (1.0, 0.6)), GREY)


@pytest.mark.parametrize("spacing", [(1.0, 1.0, 1.0), (1.0, 0.6, 1.7)])
@pytest.mark.parametrize("longest", [50, 38, 13, 7, 2])
def test_cells_have_the_mean_of_their_places(longest, spacing, device):
    """Of 38 voxels: more cells, as many as do not divide them, and so few that places are capped."""
    grid = Grid(ball(39).values[2:, 5:, :], spacing)
    matter = matter_of(grid, [SHELLS], longest, device)
    size = inside(matter).shape[::-1]
    assert max(size) == longest
    require_close(matter, brute_force(grid, [SHELLS], size))
    assert float(matter.extinction.max()) > 0.1


def test_cells_are_nearly_cubes_that_fill_the_box():
    matter = matter_of(Grid(ball(24).values[:12, :18], (1.0, 1.0, 2.0)), [RAMP], 46)
    assert inside(matter).shape == (44, 34, 46)  # of sides 23, 17 and 22
    assert inside(matter_of(Grid(ball(24).values[:2]), [RAMP], 10)).shape == (2, 10, 10)  # never fewer


@pytest.mark.parametrize("dtype", [*TYPES, "bool", ">u2", ">f4"])
def test_every_type_of_samples_hides_the_same(dtype, device):
    """A slope of whole numbers, from -60 to 60, or 0 to 120 where there is no sign."""
    x, y, z = lattice(13, 9, 11)
    low, high = {"b": (0, 1), "u": (0, 120)}.get(np.dtype(dtype).kind, (-60, 60))
    levels = np.round(low + (high - low) * (0.5 + 0.3 * x + 0.15 * y + 0.05 * z))
    tf = TransferFunction(((low, 0), (low + 0.4 * (high - low), 0.3), (high, 0.9)), GREY)
    expected, found = (
        matter_of(each, [tf], 16, device).extinction for each in (Grid(levels), Grid(levels.astype(dtype)))
    )
    assert float(expected.mean()) > 0.1
    assert torch.equal(found, expected)


def test_extinctions_of_channels_add_up(device):
    x, y, z = lattice(21, 17, 19)
    grid = Grid(1 - np.sqrt(x * x + y * y + z * z), others=(np.ascontiguousarray(x + 0.1 * z),))
    tfs = [RAMP, TransferFunction(((-0.4, 0.0), (0.1, 0.04), (1.2, 0.1)), GREY, channel=1)]
    matter = matter_of(grid, tfs, 16, device)
    require_close(matter, brute_force(grid, tfs, inside(matter).shape[::-1]))
    alone = [matter_of(grid, [tf], 16, device).extinction for tf in tfs]
    assert all(float(each.max()) > 0 for each in alone)
    torch.testing.assert_close(matter.extinction, alone[0] + alone[1])


@pytest.mark.parametrize("cuts", [
    Cuts([Plane([0.0, 0.0, 1.0], 0.1)]),
    Cuts([Plane([1.0, 0.5, 0.2], 0.13), Plane([-1.0, 2.0, 0.0], 0.21)]),
    Cuts(box=Box([-0.31, -0.2, -0.4], [0.22, 0.33, 0.1])),
])  # fmt: skip
def test_what_is_cut_away_hides_nothing(cuts, device):
    grid = ball(33)
    matter = matter_of(grid, [SHELLS], 24, device, cuts)
    require_close(matter, brute_force(grid, [SHELLS], inside(matter).shape[::-1], cuts))
    assert float(matter.extinction.sum()) < 0.9 * float(matter_of(grid, [SHELLS], 24).extinction.sum())


def test_samples_that_are_none_hide_nothing_with_all_cells_around_them(device):
    values = ball(20).values.copy()
    values[np.random.default_rng(0).random(values.shape) < 0.05] = np.nan
    matter = matter_of(Grid(values), [RAMP], 19, device)
    expected = brute_force(Grid(values), [RAMP], (19, 19, 19))
    assert (expected == 0).sum() > (brute_force(ball(20), [RAMP], (19, 19, 19)) == 0).sum()
    require_close(matter, expected)


def test_even_matter_is_even_up_to_the_sides(device):
    """Extinction is by the shortest edge of a cell. Opaque matter is as dense as any can be."""
    x, _, _ = lattice(9, 5, 7)
    grid, edge = Grid(x, (1.0, 3.0, 2.0)), 1 / 24
    for opacity, expected in ((0.3, -np.log2(0.7) * edge / UNIT), (1.0, MOST_EXTINCTION)):
        matter = matter_of(grid, [constant(opacity)], 24, device)
        assert matter.edge == pytest.approx(edge)
        torch.testing.assert_close(inside(matter), torch.full((24, 24, 16), expected).float())


@examples
@given(tf=functions(), seed=st.integers(0, 1000), longest=st.integers(2, 12))
def test_any_function_of_any_volume(tf, seed, longest):
    """Functions with steps too: of random values none is at one."""
    rng = np.random.default_rng(seed)
    grid = Grid(rng.uniform(-9, 9, rng.integers(2, 7, 3)).astype(np.float32), tuple(rng.uniform(0.5, 2, 3)))
    matter = matter_of(grid, [tf], longest)
    require_close(matter, brute_force(grid, [tf], inside(matter).shape[::-1]))


def test_what_is_not_asked_for_is_all_there():
    matter = matter_of(ball(24), [SHELLS], 16)
    whole = torch.full((18, 18, 18), 255, dtype=torch.uint8)
    lamp, sky = matter.lit(torch.tensor([0.0, 0.0, 1.0]), None).light.unbind(-1)
    assert torch.equal(sky, whole)
    assert int(lamp.min()) < 100
    lamp, sky = matter.lit(None, 0.2).light.unbind(-1)
    assert torch.equal(lamp, whole)
    assert int(sky.min()) < 100
    assert torch.equal(matter.lit(None, None).light, torch.stack([whole, whole], dim=-1))


def test_matter_that_touches_the_sides_is_lit_from_outside(device):
    """A block that fills a corner of the box is as light there as on a side within the box."""
    values = np.zeros((20, 20, 20), np.float32)
    values[:, 10:, :] = 1
    matter = matter_of(Grid(values), [constant(0.9)], 20, device)
    top = torch.tensor([[0.0, 0.5, 0.0], [0.3, 0.5, -0.2]], device=device)
    lit = matter.lit(torch.tensor([0.0, 1.0, 0.0]), 0.2)
    above = lit.at(top + torch.tensor([0.0, lit.outset, 0.0], device=device)).cpu()
    assert float(above[:, 0].min()) > 0.99
    assert float(above[:, 1].min()) > 0.8
    below = matter.lit(torch.tensor([0.0, -1.0, 0.0]), None)
    assert float(below.at(top + torch.tensor([0.0, below.outset, 0.0], device=device))[:, 0].max()) < 0.01


def test_directions_are_even():
    """Their first and second moments are those of the sphere, and neighbours are as far from each other."""
    for count in (8, 32, 128):
        directions = even_directions(count).double()
        torch.testing.assert_close(directions.norm(dim=1), torch.ones(count).double(), rtol=0, atol=1e-6)
        assert float(directions.mean(dim=0).abs().max()) < 1 / count
        assert float((directions.T @ directions / count - torch.eye(3) / 3).abs().max()) < 1 / count
        nearest = (directions @ directions.T - 2 * torch.eye(count)).amax(dim=1).arccos()
        assert float(nearest.min()) > 0.7 * float(nearest.max())


@pytest.mark.parametrize("longest", [257, 400])
def test_too_many_cells_are_refused(longest):
    refused(lambda: matter_of(ball(8), [SHELLS], longest), "expected 2 to 256 cells along an axis")


def test_other_mistakes_are_named():
    matter = matter_of(ball(8), [SHELLS], 8)
    refused(lambda: matter.lit(torch.zeros(3), None), "expected a direction")
    refused(lambda: matter.lit(None, 0.0), "expected directions and a reach above 0")
    refused(lambda: Matter(Caster(ball(8), Appearance()), [SHELLS], 0.0), "expected an opacity unit above 0")
    refused(
        lambda: Matter(Caster(ball(8), Appearance()), [], UNIT), "expected at least one transfer function"
    )
