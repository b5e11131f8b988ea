from math import pi

import numpy as np
import pytest
import torch

from texgs.core.errors import ArgumentError
from texgs.volume.generate import GENERATORS, jets, sphere, turbulence


@pytest.fixture(scope="module", autouse=True)
def one_thread():
    """Threads of torch wait for each other, which on a busy machine takes longer than the work."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


@pytest.fixture(scope="module")
def plumes():
    return jets(32)


def test_sphere_falls_from_the_centre_to_the_faces():
    grid = sphere(33)
    assert grid.values[16, 16, 16] == 1
    np.testing.assert_allclose(
        grid.values[16, 16, 16:], 0.5 + 0.5 * np.cos(pi * np.arange(17) / 16), atol=1e-6
    )
    assert grid.values[0].max() == pytest.approx(0, abs=1e-6)
    assert grid.values[0, 0, 0] == 0
    for axes in ((0, 1), (1, 2)):
        np.testing.assert_array_equal(grid.values, grid.values.swapaxes(*axes))
    np.testing.assert_allclose(grid.values, grid.values[::-1], atol=1e-6)


def test_turbulence_is_one_flow_at_every_size():
    small, large, odd = (turbulence(size, duration=0.02).values for size in (16, 48, 17))
    np.testing.assert_allclose(small, large[::3, ::3, ::3], atol=1e-5)
    assert odd.shape == (17, 17, 17)
    np.testing.assert_array_equal(small, turbulence(16, duration=0.02).values)
    assert np.abs(small - turbulence(16, seed=1, duration=0.02).values).max() > 0.1


def test_turbulence_starts_random_and_forms_thin_strong_vortices():
    # Random vorticity is Gaussian: 1 % of the volume holds 4.54 % of its square (chi-squared with three
    # degrees of freedom). Tubes concentrate it.
    start, later = (strongest_percent(turbulence(32, duration=time).values) for time in (0, 0.4))
    assert start == pytest.approx(0.0454, rel=0.05)
    assert later > 1.4 * start


def strongest_percent(strength):
    """Share of the summed squares that the strongest percent of the samples holds."""
    squares = np.sort(strength.ravel() ** 2)
    return squares[-len(squares) // 100 :].sum() / squares.sum()


def test_jets_enter_as_five_discs_and_break_up(plumes):
    floor, top = plumes.values[:, 0], plumes.values[:, -1]  # [Z, X]
    from scipy.ndimage import label

    assert label(floor > 0.5)[1] == 5
    # Area of five discs of radius 0.5 in a square of side 2 pi, counted in cells.
    assert (floor > 0.5).mean() == pytest.approx(5 * pi * 0.25 / (2 * pi) ** 2, rel=0.2)
    assert floor.max() > 0.9
    assert top.max() < 0.8
    assert (top > 0.1).mean() > 1.3 * (floor > 0.1).mean()


@pytest.mark.parametrize("name", GENERATORS)
def test_grids_are_float_cubes_between_0_and_1(name, plumes):
    grid = (
        plumes
        if name == "jets"
        else GENERATORS[name](32, **({"duration": 0.02} if name == "turbulence" else {}))
    )
    assert grid.values.dtype == np.float32
    assert len(set(grid.dims)) == 1
    assert grid.spacing == (1, 1, 1)
    assert 0 <= grid.values.min() < 0.05
    assert 0.7 < grid.values.max() <= 1


@pytest.mark.parametrize("name", GENERATORS)
def test_too_small_sizes_are_named(name):
    with pytest.raises(ArgumentError, match="size: expected at least 16 samples along each side, got 8"):
        GENERATORS[name](8)


def test_a_negative_viscosity_is_named():
    with pytest.raises(
        ArgumentError, match=r"expected a duration of at least 0 and a viscosity above 0, got 1\.5 and -1"
    ):
        turbulence(16, viscosity=-1)
