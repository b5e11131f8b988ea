"""Colours that stylising starts from: the map of colours, and pictures laid onto surfaces."""

import numpy as np
import pytest
import torch

from tests.edit.scenes import ball
from texgs.core.errors import ShapeError
from texgs.edit.style_start import color_map, project
from texgs.fields.surfels.texels import owners


def colors(seed, count, spread):
    """Correlated colours around a mean."""
    rng = np.random.default_rng(seed)
    return torch.from_numpy(rng.normal(size=(count, 3)) @ rng.normal(size=(3, 3)) * spread + rng.random(3))


def test_mean_and_covariance_become_those_of_the_style():
    own, style = colors(0, 500, 0.1), colors(1, 900, 0.3)
    matrix, shift = color_map(own, style)
    moved = own @ matrix.T + shift
    torch.testing.assert_close(moved.mean(0), style.mean(0), atol=1e-12, rtol=1e-7)
    torch.testing.assert_close(moved.T.cov(correction=0), style.T.cov(correction=0), atol=1e-10, rtol=1e-7)
    own = torch.full((50, 3), 0.4)
    matrix, shift = color_map(own, style)
    expected = style.mean(0).expand(50, 3)
    torch.testing.assert_close(own.double() @ matrix.T + shift, expected, atol=1e-3, rtol=0)


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
    texels = project(WALL, picture, pixel)
    for n, (across, along) in enumerate(WALL["sizes"].tolist()):
        for i, j in ((0, 0), (across - 1, along - 1), (1, 2)):
            at = place(n, i, j) / pixel
            expected = torch.stack([at[0] / size + 0.5, 0.5 - at[1] / size, torch.zeros(())])
            texel = texels[int(WALL["offsets"][n]) + j * across + i]
            torch.testing.assert_close(texel, expected, atol=1e-5, rtol=0)


def test_contrast_is_kept_where_projections_meet():
    p = ball(2000).parameters
    noise = torch.rand(1, 300, 300, generator=torch.Generator().manual_seed(0))
    picture = (0.3 * noise + 0.35).expand(3, -1, -1)
    texels = project(p, picture, 0.01)[:, 0]
    places, surfel = owners(p)
    steepest = (p["means"].abs() / p["means"].norm(dim=1, keepdim=True)).amax(dim=1)
    values = torch.zeros(len(steepest)).index_add_(0, surfel, texels[places] - 0.5)
    slanted, straight = values[steepest < 0.65].std(), values[steepest > 0.95].std()
    assert slanted == pytest.approx(float(straight), rel=0.25)


def test_beyond_its_edges_the_picture_is_mirrored():
    picture = torch.rand(3, 6, 6, generator=torch.Generator().manual_seed(1))
    tiled = torch.from_numpy(np.pad(picture.numpy(), ((0, 0), (24, 24), (24, 24)), mode="symmetric"))
    torch.testing.assert_close(project(WALL, picture, 0.01), project(WALL, tiled, 0.01), atol=1e-4, rtol=0)


def test_shapes_that_do_not_fit_are_named():
    with pytest.raises(ShapeError, match=r"picture: expected \[3, h, w\]"):
        project(WALL, torch.rand(20, 20, 3), 0.01)
    with pytest.raises(ShapeError, match=r"style: expected \[N, 3\], got \[3, 8\]; did you transpose"):
        color_map(torch.rand(8, 3), torch.rand(3, 8))
