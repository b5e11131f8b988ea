import numpy as np
import pytest
from scipy.stats import chisquare, kstest

from tests.refusals import refused
from texgs.core.camera import orbit
from texgs.core.light import Light, random_lights

CAMERA = orbit(0, 0, 3, 30, 8, 8)


def directions(lights):
    return np.stack([light.direction(CAMERA).numpy() for light in lights])


@pytest.mark.parametrize("azimuth", [float("nan"), float("inf")])
def test_an_azimuth_that_is_no_angle_is_refused(azimuth):
    refused(lambda: Light("directional", azimuth), f"light: .*{azimuth}")


@pytest.mark.parametrize("seed", [(0,), (0, 2), (7, 1)])
def test_random_lights_are_uniform_on_the_sphere(seed):
    # Coordinates along any axis are uniform on [-1, 1], and as many lights are in one octant as in another.
    xyz = directions(random_lights(4000, *seed))
    np.testing.assert_allclose(np.linalg.norm(xyz, axis=1), 1, rtol=1e-12)
    for axis in (*np.eye(3), np.full(3, 3**-0.5)):
        assert kstest(xyz @ axis, "uniform", (-1, 2)).pvalue > 0.01
    octants = (xyz > 0) @ [1, 2, 4]
    assert chisquare(np.bincount(octants, minlength=8)).pvalue > 0.01


def test_a_seed_has_the_same_lights_again_and_more_begin_with_them():
    assert random_lights(9, 3, 1) == random_lights(9, 3, 1)
    assert random_lights(9, 3, 1)[:4] == random_lights(4, 3, 1)
    drawn = {light for seed in ((3, 1), (3, 0), (4, 1)) for light in random_lights(9, *seed)}
    assert len(drawn) == 27
