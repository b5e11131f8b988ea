"""Colours that stylising starts from: pictures laid onto surfaces, and the map of colours."""

import numpy as np
import pytest
import torch
from torch.nn.functional import normalize

from tests.edit.scenes import ball
from tests.fitting.scenes import RADIUS
from tests.refusals import refused
from texgs.core.errors import ShapeError
from texgs.edit.style_start import RIM, color_map, projected_colors
from texgs.fields.surfels.texels import owners

WALL = {  # two parallel surfels with textures of different shapes, the second first in the list
    "means": torch.tensor([[0.1, 0.2, 0.3], [-0.2, 0.1, -0.1]]),
    "quats": torch.tensor([1.0, 0, 0, 0]).expand(2, 4),
    "scales": torch.tensor([[0.02, 0.03], [0.01, 0.05]]).log(),
    "sizes": torch.tensor([[4, 3], [2, 5]], dtype=torch.int32),
    "offsets": torch.tensor([10, 0]),
    "texels": torch.zeros(22, 3),
}


def place(n, i, j):
    """World position of a texel of the wall, from the definition."""
    (s_u, s_v), (across, along) = WALL["scales"][n].exp(), WALL["sizes"][n]
    u, v = 6 * ((i + 0.5) / across - 0.5) * s_u, 6 * ((j + 0.5) / along - 0.5) * s_v
    return WALL["means"][n] + torch.stack([u, v, torch.zeros(())])


def test_a_wall_that_faces_z_shows_the_picture_upright():
    """On a picture whose colours are its coordinates a texel reads its own place, up being up."""
    size, pixel = 200, 0.01
    x, y = torch.meshgrid(torch.arange(size) + 0.5, torch.arange(size) + 0.5, indexing="xy")
    picture = torch.stack([x / size, y / size, torch.zeros_like(x)])
    texels = projected_colors(WALL, picture, pixel)
    for n, (across, along) in enumerate(WALL["sizes"].tolist()):
        for i, j in ((0, 0), (across - 1, along - 1), (1, 2)):
            at = place(n, i, j) / pixel
            expected = torch.stack([at[0] / size + 0.5, 0.5 - at[1] / size, torch.zeros(())])
            texel = texels[int(WALL["offsets"][n]) + j * across + i]
            torch.testing.assert_close(texel, expected, atol=1e-5, rtol=0)


def test_contrast_is_the_same_whichever_way_a_surface_faces():
    p = ball(20_000).parameters
    noise = torch.rand(1, 300, 300, generator=torch.Generator().manual_seed(0))
    places, surfel = owners(p)
    texels = projected_colors(p, noise.expand(3, -1, -1), 0.01)[places, 0]
    steepest = normalize(p["means"], dim=1).abs().amax(dim=1)[surfel]
    slanted, straight = texels[steepest < 0.65].std(), texels[steepest > 0.95].std()
    assert slanted == pytest.approx(float(straight), rel=0.1)


def test_beyond_its_edges_the_picture_is_mirrored():
    picture = torch.rand(3, 6, 6, generator=torch.Generator().manual_seed(1))
    tiled = torch.from_numpy(np.pad(picture.numpy(), ((0, 0), (24, 24), (24, 24)), mode="symmetric"))
    torch.testing.assert_close(
        projected_colors(WALL, picture, 0.01), projected_colors(WALL, tiled, 0.01), atol=1e-4, rtol=0
    )


def turned(degrees, count=40, seed=0):
    """A wall that faced z, turned around y, of surfels with two texels a row: their places and parameters."""
    half = np.radians(degrees) / 2
    generator = torch.Generator().manual_seed(seed)
    flat = torch.rand(count, 2, generator=generator) - 0.5
    cos, sin = np.cos(2 * half), np.sin(2 * half)
    across = torch.tensor([cos, 0, -sin], dtype=torch.float32)  # x, turned around y
    up = torch.tensor([0.0, 1, 0])
    p = {
        "means": flat[:, :1] * across + flat[:, 1:] * up,
        "quats": torch.tensor([np.cos(half), 0, np.sin(half), 0], dtype=torch.float32).expand(count, 4),
        "scales": torch.full((count, 2), 0.01).log(),
        "sizes": torch.tensor([[2, 1]], dtype=torch.int32).expand(count, 2),
        "offsets": 2 * torch.arange(count),
        "texels": torch.zeros(2 * count, 3),
    }
    return flat, p


@pytest.mark.parametrize("degrees", [0, 20, 40])
def test_a_slanted_wall_shows_the_picture_unstretched(degrees):
    """Texels are as far from each other in the picture as they are on the wall."""
    flat, p = turned(degrees)
    size, pixel = 200, 0.02  # four times the wall: one chunk
    x, y = torch.meshgrid(torch.arange(size) + 0.5, torch.arange(size) + 0.5, indexing="xy")
    shifted = {**p, "means": p["means"] + 1.0}  # the wall is in one cell
    read = projected_colors(shifted, torch.stack([x / size, y / size, 0 * x]), pixel)
    middles = read.view(-1, 2, 3).mean(1)[:, :2] * size * pixel
    torch.testing.assert_close(torch.cdist(middles, middles), torch.cdist(flat, flat), atol=2e-3, rtol=0)


def sphere_picture(size=120):
    """A sphere that fills its picture [3, size, size] on white, in the colours of its normals."""
    at = (torch.arange(size) + 0.5) * 2 / size - 1
    y, x = torch.meshgrid(-at, at, indexing="ij")
    z = (1 - x**2 - y**2).clamp_min(0).sqrt()
    normals = torch.stack([x, y, z], 2)
    inside = (x**2 + y**2 < 1)[:, :, None]
    return torch.where(inside, 0.5 + 0.5 * normals, torch.ones(())).permute(2, 0, 1)


@pytest.mark.parametrize("pixel", [RADIUS / 60, RADIUS / 600, RADIUS / 6])  # as large, larger, smaller
def test_a_ball_gives_back_a_sphere(pixel):
    """Whatever its size is, a surfel has the colour of the sphere where the normal is its own."""
    model = ball(3000)
    p = {**model.parameters}
    p["quats"] = torch.where(torch.arange(3000)[:, None] % 2 == 0, p["quats"], flipped(p["quats"]))
    colors = projected_colors(p, sphere_picture(), pixel, sphere=True)
    places, surfel = owners(p)
    mean = torch.zeros(3000, 3).index_add_(0, surfel, colors[places]) / 25
    normals = normalize(p["means"], dim=1)
    expected = 0.5 + 0.5 * torch.cat([RIM * normals[:, :2], normals[:, 2:].abs()], 1)
    off = (mean - expected)[:, :2].abs()
    # A chunk may drift by an eighth of the picture, where normals differ by a quarter of the radius.
    assert off.mean() < 0.05
    assert off.max() < (0.03 if pixel == RADIUS / 60 else 0.14)


def flipped(quats):
    """The same planes with their normals to the other side: turned around x by half a turn."""
    w, x, y, z = quats.unbind(1)
    return torch.stack([-x, w, z, -y], 1)


@pytest.mark.parametrize("sphere", [False, True])
def test_a_plain_picture_gives_plain_colour(sphere):
    model = ball(500)
    picture = torch.tensor([0.2, 0.5, 0.9])[:, None, None].expand(3, 40, 40)
    colors = projected_colors(model.parameters, picture, 0.01, sphere)
    torch.testing.assert_close(colors, picture[:, 0, 0].expand_as(colors), atol=1e-6, rtol=0)


def some_colors(seed, count, spread):
    """Correlated colours around a mean."""
    rng = np.random.default_rng(seed)
    return torch.from_numpy(rng.normal(size=(count, 3)) @ rng.normal(size=(3, 3)) * spread + rng.random(3))


def test_mean_and_covariance_become_those_of_the_style():
    own, style = some_colors(0, 500, 0.1), some_colors(1, 900, 0.3)
    matrix, shift = color_map(own, style)
    moved = own @ matrix.T + shift
    torch.testing.assert_close(moved.mean(0), style.mean(0), atol=1e-12, rtol=1e-7)
    torch.testing.assert_close(moved.T.cov(correction=0), style.T.cov(correction=0), atol=1e-10, rtol=1e-7)
    own = torch.full((50, 3), 0.4)
    matrix, shift = color_map(own, style)
    expected = style.mean(0).expand(50, 3)
    torch.testing.assert_close(own.double() @ matrix.T + shift, expected, atol=1e-3, rtol=0)


def test_shapes_that_do_not_fit_are_named():
    wide, narrow = torch.rand(20, 20, 3), torch.rand(3, 8)
    refused(lambda: projected_colors(WALL, wide, 0.01), r"picture: expected \[3, h, w\]", ShapeError)
    refused(lambda: color_map(narrow.T, narrow), r"style: expected \[N, 3\], got \[3, 8\]; did", ShapeError)
