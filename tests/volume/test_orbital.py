"""Orbitals against their formulas in chemistry books, and against the Schrödinger equation."""

from math import pi, sqrt

import numpy as np
import pytest

from texgs.core.errors import ArgumentError
from texgs.volume.orbital import orbital_cube, wave_function

NUMBERS = [
    (n, degree, order) for n in range(1, 5) for degree in range(n) for order in range(-degree, degree + 1)
]
TABLE = {  # in Bohr radii
    (1, 0, 0): lambda x, y, z, r: np.exp(-r) / sqrt(pi),
    (2, 0, 0): lambda x, y, z, r: (2 - r) * np.exp(-r / 2) / sqrt(32 * pi),
    (2, 1, 0): lambda x, y, z, r: z * np.exp(-r / 2) / sqrt(32 * pi),
    (2, 1, -1): lambda x, y, z, r: y * np.exp(-r / 2) / sqrt(32 * pi),
    (3, 2, 0): lambda x, y, z, r: (3 * z**2 - r**2) * np.exp(-r / 3) / (81 * sqrt(6 * pi)),
    (3, 2, 1): lambda x, y, z, r: sqrt(2) * x * z * np.exp(-r / 3) / (81 * sqrt(pi)),
    (3, 2, 2): lambda x, y, z, r: (x**2 - y**2) * np.exp(-r / 3) / (81 * sqrt(2 * pi)),
    (4, 3, 0): lambda x, y, z, r: z * (5 * z**2 - 3 * r**2) * np.exp(-r / 4) / (3072 * sqrt(5 * pi)),
}


@pytest.mark.parametrize("numbers", TABLE)
def test_is_the_formula_of_the_books(numbers):
    x, y, z = np.random.default_rng(0).uniform(-12, 12, (3, 500))
    expected = TABLE[numbers](x, y, z, np.sqrt(x**2 + y**2 + z**2))
    np.testing.assert_allclose(wave_function(*numbers, x, y, z), expected, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("numbers", NUMBERS)
def test_solves_the_schrodinger_equation(numbers):
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


def test_orbitals_are_orthonormal():
    axis = np.linspace(-32, 32, 65)
    places = (axis, axis[:, None], axis[:, None, None])
    smooth = [(n, degree, order) for n, degree, order in NUMBERS if degree >= 1 and n <= 3]
    orbitals = np.stack([wave_function(*numbers, *places).ravel() for numbers in smooth])
    np.testing.assert_allclose(orbitals @ orbitals.T, np.eye(len(orbitals)), atol=2e-3)


@pytest.mark.parametrize("numbers", [(3, 2, 0), (4, 3, 0), (4, 2, -1)])
def test_a_cube_holds_the_whole_orbital_whatever_its_size(numbers):
    small, large = orbital_cube(25, *numbers), orbital_cube(97, *numbers)
    np.testing.assert_allclose(small, large[::4, ::4, ::4], atol=1e-12)
    assert 0.95 < np.abs(large).max() <= 1, "the largest amplitude is 1 and lies between samples"
    for axis in range(3):
        assert np.abs(np.take(large, (0, -1), axis)).max() <= 0.05


def test_the_axis_points_up():
    values = orbital_cube(33, 2, 1, 0)
    assert (values[:, 17:].min(), values[:, 16].max()) == (pytest.approx(0, abs=1e-2), 0)
    np.testing.assert_allclose(values, values.swapaxes(0, 2), atol=1e-12)
    np.testing.assert_allclose(values, -values[:, ::-1], atol=1e-12)


@pytest.mark.parametrize("numbers", [(0, 0, 0), (2, 2, 0), (3, 1, 2), (3, -1, 0)])
def test_numbers_that_no_orbital_has_are_refused(numbers):
    with pytest.raises(ArgumentError, match=r"orbital: expected 0 <= \|order\| <= degree < n, got n"):
        orbital_cube(16, *numbers)
