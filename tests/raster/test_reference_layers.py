"""The definition against closed forms: several primitives, and none; and what surfels and Gaussians share."""

import math

import pytest
import torch

from tests.raster.agreement import images
from tests.raster.closed_form import FOCAL, offsets, view
from tests.raster.scenes import random_scene
from texgs.raster.reference.render import rasterize
from texgs.raster.types import OUTPUTS, Options

SMOOTH = Options(alpha_min=0.0, transmittance_min=0.0)
OF_GAUSSIANS = tuple(name for name in OUTPUTS if name != "normal")
SCALES = {OUTPUTS: [0.3, 0.1], OF_GAUSSIANS: [0.3, 0.1, 0.2]}
BOTH = pytest.mark.parametrize("outputs", SCALES, ids=["surfels", "gaussians"])


@BOTH
def test_one_that_faces_the_camera_is_a_gaussian_on_screen(outputs):
    x, y = offsets()
    is_surfel = outputs == OUTPUTS
    xx, yy = ((FOCAL * scale / 2) ** 2 + (0 if is_surfel else 0.3) for scale in (0.2, 0.1))  # 4 and 2 px
    alpha = 0.8 * torch.exp(-0.5 * (x**2 / xx + y**2 / yy))
    alpha = torch.where(alpha >= 1 / 255, alpha, 0)
    color, background = torch.tensor([0.2, 0.5, 0.9]).double(), torch.tensor([1.0, 0.0, 0.5]).double()
    scales = [0.2, 0.1, 0.3][: len(SCALES[outputs])]  # the third points at the camera
    one = view(means=[[0, 0, 2]], scales=[scales], opacities=[0.8])
    image = rasterize(**one, features=color[None], background=background, outputs=outputs)
    torch.testing.assert_close(image.alpha, alpha)
    torch.testing.assert_close(image.color, alpha[..., None] * color + (1 - alpha[..., None]) * background)
    torch.testing.assert_close(image.depth, 2 * (alpha > 0).double())
    torch.testing.assert_close(image.median, 2 * (alpha > 0).double())
    torch.testing.assert_close(image.distortion, torch.zeros_like(alpha))
    if is_surfel:
        torch.testing.assert_close(image.normal, alpha[..., None] * torch.tensor([0.0, 0, -1]).double())
    else:
        assert image.normal is None
    counted = image.statistics
    torch.testing.assert_close(counted.weight_sum, alpha.sum()[None])
    torch.testing.assert_close(counted.weight_max, alpha.max()[None])
    assert counted.pixels.item() == (alpha > 0).sum()
    torch.testing.assert_close(counted.radii, torch.tensor([2 * math.log(0.8 * 255) * xx]).double().sqrt())


WIDENED = {  # variances on screen of points
    1 / 2: ([1e-4, 1e-4], Options(low_pass=2.0)),
    1 / 6: ([1e-4, 1e-4], Options(low_pass=6.0)),
    0.3: ([1e-5, 1e-5, 1e-5], Options(dilation=0.3)),
    1.0: ([1e-5, 1e-5, 1e-5], Options(dilation=1.0)),
}


@pytest.mark.parametrize("variance", WIDENED)
def test_what_is_smaller_than_a_pixel_is_widened(variance):
    x, y = offsets()
    scales, options = WIDENED[variance]
    alpha = 0.8 * torch.exp(-0.5 * (x**2 + y**2) / variance)
    tiny = view(means=[[0, 0, 2]], scales=[scales], opacities=[0.8])
    image = rasterize(**tiny, features=torch.ones(1, 1).double(), options=options)
    torch.testing.assert_close(image.alpha, torch.where(alpha >= 1 / 255, alpha, 0))


def test_two_layers():
    front, back = 0.6, 0.5  # alpha at the principal point; the back one is listed first
    layers = view(means=[[0, 0, 4], [0, 0, 2]], scales=[[0.5, 0.5]] * 2, opacities=[back, front])
    features = torch.tensor([[1.0, 0.0], [0.0, 1.0]]).double()
    image = rasterize(**layers, features=features, outputs=OUTPUTS)
    w_front, w_back = front, (1 - front) * back
    m_front, m_back = (100 / 99.99 * (1 - 0.01 / z) for z in (2, 4))
    at = (12, 15)
    torch.testing.assert_close(image.color[at], torch.tensor([w_back, w_front]).double())
    torch.testing.assert_close(image.alpha[at].item(), w_front + w_back)
    torch.testing.assert_close(image.depth[at].item(), (w_front * 2 + w_back * 4) / (w_front + w_back))
    torch.testing.assert_close(image.distortion[at].item(), w_front * w_back * (m_front - m_back) ** 2)
    assert image.median[at] == 2  # only 0.4 of the light reaches the second
    torch.testing.assert_close(image.statistics.weight_max, torch.tensor([w_back, w_front]).double())


def test_median_is_the_last_depth_that_half_of_the_light_reaches():
    means, opacities = [[0, 0, z] for z in (2, 3, 4, 5)], [0.3, 0.25, 0.2, 0.9]
    layers = view(means=means, scales=[[1, 1]] * 4, opacities=opacities)
    image = rasterize(**layers, features=torch.ones(4, 1).double(), outputs=("median",))
    assert image.median[12, 15] == 4  # light before each: 1, 0.7, 0.525, 0.42


def test_pixel_ends_before_the_fragment_that_takes_the_last_light():
    layers = view(means=[[0, 0, 2 + i] for i in range(6)], scales=[[1, 1]] * 6, opacities=[0.95] * 6)
    image = rasterize(**layers, features=torch.ones(6, 1).double(), outputs=("statistics",))
    torch.testing.assert_close(image.alpha[12, 15].item(), 1 - 0.05**3)  # 0.05^4 < 1e-4
    unended = rasterize(**layers, features=torch.ones(6, 1).double(), options=SMOOTH)
    torch.testing.assert_close(unended.alpha[12, 15].item(), 1 - 0.05**6)


@BOTH
def test_what_is_too_near_or_too_weak_is_skipped(outputs):
    means, opacities = [[0, 0, 0.01], [0, 0, -2], [0, 0, 2], [0, 0, 2]], [0.9, 0.9, 0.0, 0.003]
    primitives = view(means=means, scales=[SCALES[outputs]] * 4, opacities=opacities)
    image = rasterize(**primitives, features=torch.ones(4, 1).double(), outputs=outputs)
    assert image.alpha.count_nonzero() == 0
    assert image.statistics.radii.count_nonzero() == 0


@BOTH
def test_alpha_is_capped_and_the_cap_blocks_the_gradient(outputs):
    primitive = view(means=[[0, 0, 2]], scales=[SCALES[outputs]], opacities=[1.0])
    primitive["opacities"].requires_grad_()
    alpha = rasterize(**primitive, features=torch.ones(1, 1).double()).alpha[12, 15]
    assert alpha == 0.99
    assert torch.autograd.grad(alpha, primitive["opacities"])[0] == 0


@BOTH
def test_shift_moves_the_projection(outputs):
    quats = [[0.8, 0.3, 0.5, 0.1]]
    primitive = view(means=[[0.1, 0, 2]], scales=[SCALES[outputs]], opacities=[0.8], quats=quats)
    ones, pixels = torch.ones(1, 1).double(), torch.tensor([1.5, -0.75]).double()
    shifted = images(rasterize(**primitive, features=ones, shift=pixels[None], outputs=outputs))
    primitive["K"][:2, 2] += pixels
    moved = images(rasterize(**primitive, features=ones, outputs=outputs))
    assert len(moved) == len(outputs) + 1
    torch.testing.assert_close(shifted, moved)


def test_coincident_depths_keep_the_order_of_the_inputs():
    pair = view(means=[[0, 0, 2]] * 2, scales=[[0.2, 0.2]] * 2, opacities=[0.5, 0.5])
    image = rasterize(**pair, features=torch.eye(2).double())
    torch.testing.assert_close(image.color[12, 15], torch.tensor([0.5, 0.25]).double())


def test_no_surfels_show_the_background():
    scene = random_scene(n=0, width=3, height=2, channels=4)
    image = scene.render(rasterize, OUTPUTS)
    assert (image.color == scene.background).all()
    assert image.alpha.count_nonzero() == image.depth.count_nonzero() == image.median.count_nonzero() == 0
