"""Lookups against SciPy's interpolation of samples and of their differences, in float64."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy.ndimage import map_coordinates

from tests.volume.scenes import SHELLS, ball
from texgs.core.errors import ArgumentError, ShapeError
from texgs.core.geometry import facing
from texgs.volume.caster import TYPES, Caster
from texgs.volume.grid import Grid
from texgs.volume.lookup import COLUMNS, Lookup
from texgs.volume.render import Appearance
from texgs.volume.transfer import TransferFunction

RANGE = TransferFunction(((0, 0.0), (20, 0.4), (90, 0.8)), ((10, 0.9, 0.1, 0.2), (60, 0.1, 0.8, 0.5)))


def noise(kind: str = "float32") -> Grid:
    values = np.random.default_rng(0).integers(0, 100, (7, 9, 12)).astype(kind)
    return Grid(values, (1.0, 0.7, 1.9))


def somewhere(grid: Grid, count: int = 301) -> torch.Tensor:
    """Points in a volume, and a few beyond it."""
    unit = 2.2 * torch.rand(count, 3, generator=torch.Generator().manual_seed(0)) - 1.1
    return unit * torch.tensor(grid.aabb[1])


def interpolated(samples: np.ndarray, grid: Grid, points: torch.Tensor) -> np.ndarray:
    places = (points.cpu().double().numpy() / np.array(grid.aabb[1]) + 1) / 2 * (np.array(grid.dims) - 1)
    return map_coordinates(samples.astype(float), places.T[::-1], order=1, mode="nearest")


def differences(grid: Grid) -> list[np.ndarray]:
    """Central differences at the samples along x, y and z, per world unit."""
    padded, inner = np.pad(grid.values.astype(float), 1, mode="edge"), slice(1, -1)
    steps = np.array(grid.spacing) * grid.scale
    ahead = [padded[inner, inner, 2:], padded[inner, 2:, inner], padded[2:, inner, inner]]
    behind = [padded[inner, inner, :-2], padded[inner, :-2, inner], padded[:-2, inner, inner]]
    return [(high - low) / (2 * step) for high, low, step in zip(ahead, behind, steps, strict=True)]


@pytest.mark.parametrize("kind", TYPES)
def test_lookups_are_those_of_scipy(device, kind):
    grid = noise(kind)
    points = somewhere(grid).to(device)
    seen = {
        name: x.cpu()
        for name, x in Lookup(Caster(grid, Appearance(), device), RANGE).at(points, COLUMNS).items()
    }
    values = interpolated(grid.values, grid, points)
    gradients = np.stack([interpolated(along, grid, points) for along in differences(grid)], axis=1)
    np.testing.assert_allclose(seen["values"], values, atol=1e-4)
    np.testing.assert_allclose(seen["gradients"], gradients, atol=1e-5 * np.abs(gradients).max())
    np.testing.assert_allclose(seen["colors"], RANGE(values.clip(*RANGE.support))[:, :3], atol=1e-5)
    torch.testing.assert_close(seen["quats"], facing(seen["gradients"]), atol=1e-4, rtol=0)


def test_colors_are_those_of_the_nearest_value_that_the_function_shows(device):
    tf = TransferFunction(((0, 0), (40, 0), (50, 1), (60, 0), (100, 0)), ((0, 0, 0, 0), (100, 1, 1, 1)))
    grid = noise()
    points = somewhere(grid).to(device)
    colors = Lookup(Caster(grid, Appearance(), device), tf).at(points, ["colors"])["colors"].cpu()
    shown = interpolated(grid.values, grid, points).clip(40, 60)
    np.testing.assert_allclose(colors, (shown / 100)[:, None].repeat(3, axis=1), atol=1e-5)


def test_quats_do_nothing_where_nothing_changes_and_turn_by_half_to_the_opposite(device):
    points = torch.zeros(1, 3, device=device)
    z = np.linspace(1, 0, 5, dtype=np.float32)[:, None, None] * np.ones((1, 5, 5), np.float32)
    for values, quat in ((np.full((5, 5, 5), 0.5, np.float32), [1, 0, 0, 0]), (z, [0, 1, 0, 0])):
        quats = Lookup(Caster(Grid(values), Appearance(), device), SHELLS).at(points, ["quats"])["quats"]
        torch.testing.assert_close(quats.cpu(), torch.tensor([quat]).float())


def test_values_beside_missing_samples_are_missing(device):
    grid = ball(9)
    grid.values[4, 4, 4] = np.nan
    points = torch.tensor([[0.01, 0.0, 0.0], [0.3, 0.0, 0.0]], device=device)
    seen = Lookup(Caster(grid, Appearance(), device), SHELLS).at(points, COLUMNS)
    assert seen["values"].isnan().tolist() == [True, False]
    assert seen["quats"].isfinite().all()
    assert seen["colors"].isfinite().all()


@given(st.integers(0, 70))
def test_each_point_is_looked_up_by_itself(count):
    lookup, points = Lookup(Caster(noise(), Appearance()), RANGE), somewhere(noise(), 70)
    whole, part = lookup.at(points, COLUMNS), lookup.at(points[:count], COLUMNS)
    assert all(torch.equal(whole[name][:count], part[name]) for name in COLUMNS)


def test_other_outputs_and_points_are_refused():
    lookup = Lookup(Caster(ball(9), Appearance()), SHELLS)
    with pytest.raises(ArgumentError, match=r"outputs: expected some of values, .*, got curvature"):
        lookup.at(torch.zeros(1, 3), ["curvature"])
    with pytest.raises(ShapeError, match="points"):
        lookup.at(torch.zeros(3), ["values"])
