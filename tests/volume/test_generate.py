"""Generated volumes: orbitals against books and the Schroedinger equation, flows against statistics."""

from itertools import pairwise
from math import pi, sqrt

import numpy as np
import pytest
from scipy.ndimage import label

from texgs.volume import generate
from texgs.volume.generate import (
    GENERATORS,
    SERIES,
    flame,
    jets,
    orbital_cube,
    series,
    sphere,
    turbulence,
    wave_function,
)

NUMBERS = [
    (n, degree, order) for n in range(1, 5) for degree in range(n) for order in range(-degree, degree + 1)
]
TABLE = {  # in Bohr radii
    (1, 0, 0): lambda x, y, z, r: np.exp(-r) / sqrt(pi),
    (2, 1, -1): lambda x, y, z, r: y * np.exp(-r / 2) / sqrt(32 * pi),
    (3, 2, 1): lambda x, y, z, r: sqrt(2) * x * z * np.exp(-r / 3) / (81 * sqrt(pi)),
    (3, 2, 2): lambda x, y, z, r: (x**2 - y**2) * np.exp(-r / 3) / (81 * sqrt(2 * pi)),
    (4, 3, 0): lambda x, y, z, r: z * (5 * z**2 - 3 * r**2) * np.exp(-r / 4) / (3072 * sqrt(5 * pi)),
}


@pytest.mark.parametrize("numbers", TABLE)
def test_an_orbital_is_the_formula_of_the_books(numbers):
    x, y, z = np.random.default_rng(0).uniform(-12, 12, (3, 500))
    expected = TABLE[numbers](x, y, z, np.sqrt(x**2 + y**2 + z**2))
    np.testing.assert_allclose(wave_function(*numbers, x, y, z), expected, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("numbers", NUMBERS)
def test_an_orbital_solves_the_schrodinger_equation(numbers):
    """-laplace(psi) / 2 - psi / r = E psi with E = -1 / (2 n^2), by differences of fourth order."""
    step, weights = 0.05, {0: -5 / 2, 1: 4 / 3, -1: 4 / 3, 2: -1 / 12, -2: -1 / 12}
    points = np.random.default_rng(1).uniform(-9, 9, (3, 200))
    points = points[:, np.linalg.norm(points, axis=0) > 2]
    shifts = step * np.eye(3)[:, :, None]
    laplacian = sum(
        weight * wave_function(*numbers, *(points + count * shift))
        for count, weight in weights.items()
        for shift in shifts
    ) / step**2  # fmt: skip
    psi = wave_function(*numbers, *points)
    energy = -0.5 * laplacian - psi / np.linalg.norm(points, axis=0)
    np.testing.assert_allclose(energy, -psi / (2 * numbers[0] ** 2), atol=1e-5 * np.abs(psi).max())


@pytest.mark.parametrize("numbers", [(3, 2, 0), (4, 3, 0), (4, 2, -1)])
def test_a_cube_holds_the_whole_orbital_whatever_its_size(numbers):
    small, large = orbital_cube(25, *numbers), orbital_cube(97, *numbers)
    np.testing.assert_allclose(small, large[::4, ::4, ::4], atol=1e-12)
    assert 0.95 < np.abs(large).max() <= 1, "the largest amplitude is 1 and lies between samples"
    for axis in range(3):
        assert np.abs(np.take(large, (0, -1), axis)).max() <= 0.05


def test_the_axis_of_an_orbital_points_up():
    values = orbital_cube(33, 2, 1, 0)
    assert (values[:, 17:].min(), values[:, 16].max()) == (pytest.approx(0, abs=1e-2), 0)
    np.testing.assert_allclose(values, values.swapaxes(0, 2), atol=1e-12)
    np.testing.assert_allclose(values, -values[:, ::-1], atol=1e-12)


@pytest.fixture(scope="module")
def plumes(one_thread):
    return jets(32)


@pytest.fixture
def short(monkeypatch, one_thread):
    """Turbulence that has hardly begun."""
    monkeypatch.setattr(generate, "DURATION", 0.02)


def test_sphere_falls_from_the_centre_to_the_faces():
    values = sphere(33).values
    assert values[16, 16, 16] == 1
    np.testing.assert_allclose(values[16, 16, 16:], 0.5 + 0.5 * np.cos(pi * np.arange(17) / 16), atol=1e-6)
    assert values[0].max() == pytest.approx(0, abs=1e-6)
    assert values[0, 0, 0] == 0
    for axes in ((0, 1), (1, 2)):
        np.testing.assert_array_equal(values, values.swapaxes(*axes))
    np.testing.assert_allclose(values, values[::-1], atol=1e-6)


def test_turbulence_is_one_flow_at_every_size(short):
    small, large, odd = (turbulence(size).values for size in (16, 48, 17))
    np.testing.assert_allclose(small, large[::3, ::3, ::3], atol=1e-5)
    assert odd.shape == (17, 17, 17)
    np.testing.assert_array_equal(small, turbulence(16).values)
    assert np.abs(small - turbulence(16, seed=1).values).max() > 0.1


def test_turbulence_starts_random_and_forms_thin_strong_vortices(monkeypatch, one_thread):
    # Random vorticity is Gaussian: 1 % of the volume holds 4.54 % of its square (chi-squared with three
    # degrees of freedom). Tubes concentrate it.
    shares = []
    for duration in (0, 0.4):
        monkeypatch.setattr(generate, "DURATION", duration)
        squares = np.sort(turbulence(32).values.ravel() ** 2)
        shares.append(squares[-len(squares) // 100 :].sum() / squares.sum())
    assert shares[0] == pytest.approx(0.0454, rel=0.05)
    assert shares[1] > 1.4 * shares[0]


def test_jets_enter_as_five_discs_and_break_up(plumes):
    floor, top = plumes.values[:, 0], plumes.values[:, -1]  # [Z, X]
    assert label(floor > 0.5)[1] == 5
    # Area of five discs of radius 0.5 in a square of side 2 pi, counted in cells.
    assert (floor > 0.5).mean() == pytest.approx(5 * pi * 0.25 / (2 * pi) ** 2, rel=0.2)
    assert floor.max() > 0.9
    assert top.max() < 0.8
    assert (top > 0.1).mean() > 1.3 * (floor > 0.1).mean()


@pytest.mark.parametrize("name", GENERATORS)
def test_grids_are_float_cubes_between_0_and_1(name, plumes, short):
    grid = plumes if name == "jets" else GENERATORS[name](32)
    assert grid.values.dtype == np.float32
    assert len(set(grid.dims)) == 1
    assert grid.spacing == (1, 1, 1)
    assert 0 <= grid.values.min() < 0.05
    assert 0.7 < grid.values.max() <= 1


@pytest.mark.parametrize("name", SERIES)
def test_a_series_has_its_steps_in_the_range_of_volumes_and_is_the_same_again(name):
    one, again = (series(name, 24, 5) for _ in range(2))
    assert len(one) == 5
    for grid, same in zip(one, again, strict=True):
        assert grid.values.dtype == np.float32
        assert grid.values.min() >= 0
        assert 0.5 < grid.values.max() <= 1
        np.testing.assert_array_equal(grid.values, same.values)
    assert all(np.abs(a.values - b.values).max() > 0.1 for a, b in pairwise(one))


@pytest.mark.parametrize("name", SERIES)
def test_more_steps_show_the_same_motion_more_finely(name):
    coarse, fine = series(name, 24, 3), series(name, 24, 5)
    for index, grid in enumerate(coarse):
        np.testing.assert_allclose(grid.values, fine[2 * index].values, atol=1e-6)


def test_rings_change_places_as_they_climb():
    """The radii in which vorticity lies below and above its middle are exchanged."""
    radii, heights = [], []
    axis = np.linspace(-1, 1, 64)
    z, y, x = np.meshgrid(axis, axis, axis, indexing="ij")
    for grid in series("rings", 64, 3):
        weights, distance = grid.values**2, np.hypot(x, z)
        heights.append((weights * y).sum() / weights.sum())
        wide = distance > 0.42
        radii.append([(weights * y * part).sum() / (weights * part).sum() for part in (wide, ~wide)])
    assert heights[0] < heights[1] < heights[2]
    assert abs(radii[0][0] - radii[0][1]) < 0.05  # both at one height: the narrow one is about to pass
    assert abs(radii[2][0] - radii[2][1]) < 0.05


def test_tongues_part_from_a_flame():
    parts = [label(grid.values > 0.15)[1] for grid in series("flame", 48, 20)]
    assert min(parts) == 1
    assert max(parts) > 1


def test_a_seed_makes_another_flame():
    one, other = (flame(24, 0.0, seed) for seed in (0, 1))
    assert np.abs(one.values - other.values).max() > 0.1
