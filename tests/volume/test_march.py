import numpy as np
import pytest
import torch
from torch.nn.functional import normalize

from tests.volume.march import march, shade
from tests.volume.scenes import ball, constant, lattice
from texgs.core.camera import Camera, orbit
from texgs.core.light import HEADLIGHT
from texgs.volume.grid import Grid
from texgs.volume.render import Appearance
from texgs.volume.transfer import TransferFunction

SOLID = TransferFunction(((0.3, 1.0), (2, 1.0)), ((0, 0.5, 0.5, 0.5),))  # of `ball`: radius 0.35 in the world


def sphere(camera: Camera, radius: float):
    """Camera z [H, W] and normal [H, W, 3] of a sphere around the origin in closed form; z 0 where missed."""
    rays, origin = camera.rays().double(), camera.position.double()
    a, b, c = (rays * rays).sum(-1), rays @ origin, origin @ origin - radius**2
    root = b * b - a * c
    z = torch.where(root > 0, (-b - root.clamp_min(0).sqrt()) / a, 0)
    return z, normalize(origin + z[..., None] * rays, dim=-1) * (root > 0)[..., None], root / b**2


@pytest.mark.parametrize(("azimuth", "polar", "width", "height"),
                         [(-90, 0, 50, 50), (20, 50, 70, 40), (-160, -90, 40, 60)])  # fmt: skip
def test_depth_and_normal_of_an_opaque_ball(azimuth, polar, width, height):
    camera = orbit(azimuth, polar, 2.5, 25, width, height)
    seen = march(ball(64), SOLID, camera, Appearance(step=0.2, opacity_unit=0.0005), HEADLIGHT)
    z, n, root = sphere(camera, 0.35)
    inner, outside = root > 0.002, root < -0.002
    assert seen.depth.dtype == seen.normal.dtype == torch.float32
    assert not seen.depth[outside].any()
    assert not seen.normal[outside].any()
    torch.testing.assert_close(seen.depth[inner].double(), z[inner], atol=0.0045, rtol=0)
    torch.testing.assert_close(seen.normal[inner].double(), n[inner], atol=0.03, rtol=0)


def test_expected_depth_of_fog_is_that_of_the_exponential():
    x, _, _ = lattice(17, 17, 17)
    camera = orbit(-90, 0, 3, 10, 9, 9)
    seen = march(Grid(x), constant(0.1), camera, Appearance(step=0.05, opacity_unit=0.05), HEADLIGHT)
    sigma = -np.log(0.9) / 0.05  # per world unit, over a length of 1 from z = 2.5
    assert seen.alpha[4, 4] == pytest.approx(1 - np.exp(-sigma), abs=1e-4)
    mean = 1 / sigma - np.exp(-sigma) / (1 - np.exp(-sigma))
    assert seen.depth[4, 4] == pytest.approx(2.5 + mean, abs=1e-3)


def test_normals_are_turned_towards_the_camera_and_follow_the_spacing():
    x, y, _ = lattice(17, 17, 17)
    grid = Grid(x + y, (1.0, 2.0, 1.0))
    tf = TransferFunction(((-0.5, 0.5), (0.5, 0.5)), ((0, 1, 1, 1),))
    expected = torch.tensor([2.0, 1.0, 0.0]) / 5**0.5
    for azimuth, sign in [(0, 1), (180, -1)]:
        look = Appearance(step=0.5, opacity_unit=0.01)
        normal = march(grid, tf, orbit(azimuth, 0, 3, 10, 5, 5), look, HEADLIGHT).normal
        torch.testing.assert_close(normal[2, 2], sign * expected, atol=1e-3, rtol=0)


def test_shading_of_single_samples():
    look = Appearance(ambient=0.2, diffuse=0.5, specular=0.4, shininess=8)
    color, x, z = torch.tensor([[0.6, 0.3, 1.0]]), torch.tensor([1.0, 0, 0]), torch.tensor([0.0, 0, 1])
    lit = shade(color, z[None], z, z, look)  # everything along z
    torch.testing.assert_close(lit, (color * 0.7 + 0.4).clamp(max=1))
    torch.testing.assert_close(shade(color, -z[None], z, z, look), lit)  # two-sided
    torch.testing.assert_close(shade(color, z[None], z, -z, look), color * 0.2)  # lit from behind
    torch.testing.assert_close(shade(color, 0 * z[None], z, z, look), color * 0.2)
    half = normalize(torch.tensor([[1.0, 0, 1]]))
    expected = (color * (0.2 + 0.5 * 0.5**0.5) + 0.4).clamp(max=1)
    torch.testing.assert_close(shade(color, half, z, x, look), expected)
