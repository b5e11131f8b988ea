"""The definition of surfels against closed forms: one of them."""

import math
from dataclasses import replace

import pytest
import torch

from tests.raster.closed_form import CENTRE, FOCAL, HEIGHT, WIDTH, offsets, view
from tests.raster.scenes import random_scene, textured_with_features
from texgs.core.geometry import quats_to_matrices
from texgs.raster.reference.render import rasterize
from texgs.raster.reference.surfels import project
from texgs.raster.types import OUTPUTS, Options, Texture

UNFILTERED = Options(low_pass=1e30)
SMOOTH = Options(alpha_min=0.0, transmittance_min=0.0)


def test_tilted_surfel_is_hit_where_the_ray_meets_its_plane():
    angle, scale = 1.1, 0.3  # about y, so that the plane is n . x = n . mean with n = (sin, 0, cos)
    x, y = offsets()
    ray = torch.stack([x / FOCAL, y / FOCAL, torch.ones_like(x)], -1)
    mean = torch.tensor([0.1, -0.05, 2.0]).double()
    normal = torch.tensor([math.sin(angle), 0, math.cos(angle)]).double()
    z = (mean @ normal) / (ray @ normal)
    point = z[..., None] * ray - mean
    u = point @ torch.tensor([math.cos(angle), 0, -math.sin(angle)]).double() / scale
    v = point[..., 1] / scale
    alpha = torch.where(z > 0.2, 0.9 * torch.exp(-0.5 * (u**2 + v**2)), 0)
    alpha = torch.where(alpha >= 1 / 255, alpha, 0)
    tilted = view(
        means=[mean.tolist()],
        scales=[[scale, scale]],
        opacities=[0.9],
        quats=[[2 * math.cos(angle / 2), 0, 2 * math.sin(angle / 2), 0]],  # length 2 does not matter
    )
    image = rasterize(**tilted, features=torch.ones(1, 1).double(), outputs=OUTPUTS, options=UNFILTERED)
    torch.testing.assert_close(image.alpha, alpha)
    torch.testing.assert_close(image.depth, torch.where(alpha > 0, z, 0))
    torch.testing.assert_close(image.normal, alpha[..., None] * -normal)


@pytest.mark.parametrize("sigma", [1.0, 3.0])
def test_filter_sits_in_the_middle_of_the_projected_box(sigma):
    tilted = view(means=[[0.2, 0.1, 2]], scales=[[0.3, 0.2]], opacities=[0.5], quats=[[0.8, 0.3, 0.5, 0.1]])
    angle = torch.linspace(0, 2 * math.pi, 100_001).double()
    circle = sigma * torch.stack([0.3 * angle.cos(), 0.2 * angle.sin()], -1)
    points = tilted["means"] + circle @ quats_to_matrices(tilted["quats"])[0, :, :2].T
    pixels = FOCAL * points[:, :2] / points[:, 2:] + torch.tensor(CENTRE).double()
    middle = (pixels.amin(0) + pixels.amax(0)) / 2
    names = ("means", "quats", "scales", "opacities", "viewmat", "K")
    options = Options(filter_sigma=sigma)
    centre = project(*(tilted[name] for name in names), None, (WIDTH, HEIGHT), options).centre[0]
    torch.testing.assert_close(centre, middle, atol=1e-6, rtol=0)


def test_known_texels():
    # 6 sigma = 24 px wide and high: texels of 4 x 6 px, whose centres fall on pixel centres
    texels = torch.rand(5 + 6 * 4, 3).double()
    texture = Texture(
        base=torch.tensor([[0.1, 0.2, 0.3]]).double(),
        gain=torch.tensor([0.7]).double(),
        texels=texels,
        sizes=torch.tensor([[6, 4]], dtype=torch.int32),
        offsets=torch.tensor([5]),
    )
    surfel = view(means=[[0, 0, 2]], scales=[[0.2, 0.2]], opacities=[0.8])
    image = rasterize(**surfel, texture=texture, options=SMOOTH)
    color = (image.color / image.alpha[..., None] - texture.base) / 0.7
    texel = texels[5:].reshape(4, 6, 3)  # [along v, along u, 3]
    centres = color[12 - 9 : 12 + 10 : 6, 15 - 10 : 15 + 11 : 4]
    torch.testing.assert_close(centres, texel)
    torch.testing.assert_close(color[12 - 9, 15 - 8], (texel[0, 0] + texel[0, 1]) / 2)
    torch.testing.assert_close(color[12 - 6, 15 - 9], bilinear(texel, 0.25, 0.5))
    torch.testing.assert_close(color[0, 0], texel[0, 0])  # beyond the outermost centres: replicated


def bilinear(texel, x, y):
    """Value [3] between the first two texels along each axis."""
    top = (1 - x) * texel[0, 0] + x * texel[0, 1]
    return (1 - y) * top + y * ((1 - x) * texel[1, 0] + x * texel[1, 1])


def test_edge_on_surfel_is_drawn_by_the_low_pass_filter_alone():
    x, y = offsets()
    half_turn = math.sqrt(0.5)
    quats = [[half_turn, 0, half_turn, 0]]
    surfel = view(means=[[0, 0, 2]], scales=[[0.3, 0.2]], opacities=[0.8], quats=quats)
    leaves = [surfel[name].requires_grad_() for name in ("means", "quats", "scales", "opacities")]
    image = rasterize(**surfel, features=torch.ones(1, 1).double(), outputs=OUTPUTS)
    off_plane = x != 0
    alpha = 0.8 * torch.exp(-(x**2 + y**2))
    torch.testing.assert_close(image.alpha[off_plane], torch.where(alpha >= 1 / 255, alpha, 0)[off_plane])
    total = image.color.sum() + image.depth.sum() + image.normal.sum() + image.distortion.sum()
    assert all(bool(gradient.isfinite().all()) for gradient in torch.autograd.grad(total, leaves))


def test_features_beside_a_texture_follow_it():
    scene = textured_with_features(random_scene(n=20, width=12, height=9), 2).double()
    both = scene.render(rasterize, ("depth",))
    background = scene.background
    texture = replace(scene, features=None, background=background[:3]).render(rasterize, ("depth",))
    features = replace(scene, texture=None, background=background[3:]).render(rasterize)
    torch.testing.assert_close(both.color, torch.cat([texture.color, features.color], -1))
    torch.testing.assert_close(both.depth, texture.depth)
