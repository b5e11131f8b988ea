"""Losses of images and depths: closed forms, what they skip, graphs that are used again."""

import math

import numpy as np
import pytest
import torch
from torch.nn.functional import normalize

from tests.raster.operations import OPERATIONS, bumps_with_normals, evaluate, maps, pair
from tests.refusals import refused
from texgs.core.camera import orbit
from texgs.raster.losses import bilateral_smoothness, depth_to_normal, l1_dssim, normal_consistency, ssim
from texgs.raster.reference import losses as definition

SIZES = OPERATIONS["l1_dssim, lambda 0.2"].sizes


def on(device, inputs):
    """Return inputs on a device."""
    return {name: x.to(device) for name, x in inputs.items()}


def pair_of(image, target):
    """Return two images as arguments."""
    return {"image": image, "target": target}


def of_loss(loss, given, leaf="image"):
    """Return a value and its gradient."""
    (value,), (gradient,) = evaluate(loss, given, (leaf,))
    return value, gradient


def test_definition_window_by_window():
    """Wang et al. 2004, written out: 11 x 11 Gaussian windows, zeros outside of the image."""
    image, target = (x[..., 0].double().numpy() for x in pair(9, 14, 1).values())
    offsets = np.arange(-5, 6)
    weights = np.exp(-(offsets[:, None] ** 2 + offsets**2) / (2 * 1.5**2))
    weights /= weights.sum()
    values = []
    for y, x in np.ndindex(image.shape):
        a, b = (np.pad(each, 5)[y : y + 11, x : x + 11] for each in (image, target))
        mean_a, mean_b = (weights * a).sum(), (weights * b).sum()
        var_a, var_b = (weights * a * a).sum() - mean_a**2, (weights * b * b).sum() - mean_b**2
        covariance = (weights * a * b).sum() - mean_a * mean_b
        likeness = (2 * mean_a * mean_b + 0.01**2) * (2 * covariance + 0.03**2)
        values.append(likeness / ((mean_a**2 + mean_b**2 + 0.01**2) * (var_a + var_b + 0.03**2)))
    similarity = definition.ssim(*(torch.from_numpy(each)[..., None] for each in (image, target)))
    assert similarity.item() == pytest.approx(np.mean(values), rel=1e-9)


@pytest.mark.parametrize("size", SIZES)
def test_equal_images(size, device):
    target = pair(*size)["target"].to(device)
    value, gradient = of_loss(l1_dssim, pair_of(target.clone(), target))
    assert ssim(target, target).item() == 1
    assert value.item() == 0
    assert not gradient.any()


@pytest.mark.parametrize("box", [(0, 3, 0, 5), (100, 140, 250, 262), (149, 150, 299, 300), (20, 21, 0, 300)])
def test_skipping_equal_windows_changes_nothing(box, device):
    top, bottom, left, right = box
    noisy, target = pair(150, 300, 3).values()
    image = target.clone()
    image[top:bottom, left:right] = noisy[top:bottom, left:right]
    given = pair_of(image, target)
    value, gradient = of_loss(l1_dssim, on(device, given))
    expected, gradient_there = of_loss(definition.l1_dssim, {name: x.double() for name, x in given.items()})
    assert value.item() == pytest.approx(expected.item(), rel=1e-5)
    assert (gradient.cpu() - gradient_there).norm() < 1e-5 * gradient_there.norm()
    reach = 10  # two window radii
    outside = torch.ones(150, 300, dtype=torch.bool)
    outside[max(top - reach, 0) : bottom + reach, max(left - reach, 0) : right + reach] = False
    assert not gradient[outside].any()


def test_memory_layouts_agree(device):
    image, target = on(device, pair(40, 50, 3)).values()
    expected = of_loss(l1_dssim, pair_of(image, target))
    for other in (image.contiguous(), image.repeat(1, 2, 1)[:, :50], image.flip(0).flip(0)):
        value, gradient = of_loss(l1_dssim, pair_of(other, target.contiguous()))
        assert value == expected[0]
        assert torch.equal(gradient, expected[1])
    assert l1_dssim(image, target) == expected[0], "with and without a gradient"
    expected = of_loss(l1_dssim, pair_of(image[..., :1], target[..., :1]))
    value, gradient = of_loss(l1_dssim, pair_of(image[..., 0], target[..., 0]))
    assert value == expected[0], "one plane needs no axis of channels"
    assert torch.equal(gradient, expected[1][..., 0])


def test_a_retained_graph_can_be_used_again_until_its_target_has_changed(device):
    image, target = on(device, pair(20, 30, 3)).values()
    _, gradient = of_loss(lambda image, target: 0.25 * l1_dssim(image, target), pair_of(image, target))
    image = image.detach().requires_grad_()
    target = target.permute(2, 0, 1).contiguous().permute(1, 2, 0)  # planar memory is not copied
    value = l1_dssim(image, target)
    for _ in range(3):
        value.backward(retain_graph=True)
    torch.testing.assert_close(image.grad, -3 * 4 * gradient)  # the weight of one value is -1 in `evaluate`
    target.zero_()
    refused(value.backward, "modified by an inplace operation", RuntimeError)


def test_what_is_not_finite_is_not_skipped(device):
    image, target = on(device, pair(40, 50, 3)).values()
    image = image.clone()
    image[20, 20, 1] = float("nan")
    assert ssim(image, target).isnan()
    guide = torch.full((8, 9, 3), float("nan"), device=device)
    attribute, alpha = torch.rand(8, 9, device=device), torch.ones(8, 9, device=device)
    assert bilateral_smoothness(attribute, guide, alpha).isnan()


def test_a_step_of_the_attribute_by_hand(device):
    attribute, guide, alpha = (torch.zeros(9, 12), torch.full((9, 12, 3), 0.5), torch.zeros(9, 12))
    attribute[:, 6:] = 0.25
    alpha[3:6, 4:8] = 1  # away from the border; the step lies between columns 5 and 6
    value = bilateral_smoothness(attribute.to(device), guide.to(device), alpha.to(device))
    assert value.item() == pytest.approx(3 * 2 * 0.5 * 0.25 / (9 * 12), rel=1e-6)
    guide[:, 6:] = 0.75  # the same step in the guide
    value = bilateral_smoothness(attribute.to(device), guide.to(device), alpha.to(device))
    assert value.item() == pytest.approx(3 * 2 * 0.5 * 0.25 * math.exp(-0.5 * 0.25) / (9 * 12), rel=1e-6)


def test_a_constant_attribute_inside_costs_nothing(device):
    given = on(device, maps(30, 40, 1))
    alpha = given["alpha"]
    alpha[[0, -1]] = 0
    alpha[:, [0, -1]] = 0  # the zeros outside the image are an edge
    given["attribute"] = torch.full_like(alpha, 0.7)
    value, gradient = of_loss(bilateral_smoothness, given, "attribute")
    assert value.item() == 0
    assert not gradient.any()


def test_a_plane_has_its_normal(device):
    camera = orbit(30, 20, 3.0, 40.0, 40, 30)
    R_cw, t_cw, K = camera.viewmat[:3, :3].double(), camera.viewmat[:3, 3].double(), camera.K.double()
    plane = normalize(torch.tensor([1.0, 0.5, -0.3]).double(), dim=0)  # through the origin
    facing = R_cw @ plane
    y, x = torch.meshgrid(torch.arange(30).double() + 0.5, torch.arange(40).double() + 0.5, indexing="ij")
    rays = torch.stack([(x - K[0, 2]) / K[0, 0], (y - K[1, 2]) / K[1, 1], torch.ones_like(x)], -1)
    depth = (facing @ t_cw) / (rays @ facing)
    towards_camera = -torch.sign(facing @ t_cw) * plane
    normal = depth_to_normal(depth.float().to(device), camera.viewmat.to(device), camera.K.to(device)).cpu()
    expected = towards_camera.expand(28, 38, 3)
    assert (normal[1:-1, 1:-1] - expected).norm() <= 1e-5 * expected.norm()
    assert not normal[[0, -1]].any()
    assert not normal[:, [0, -1]].any()


def test_agreeing_normals_cost_what_alpha_leaves(device):
    given = on(device, bumps_with_normals(20, 30))
    given["normal"] = depth_to_normal(given["depth"], given["viewmat"], given["K"])
    known = (given["normal"].norm(dim=-1) > 0.5).double()
    expected = 1 - (given["alpha"].double() * known).mean()
    assert normal_consistency(**given).item() == pytest.approx(expected.item(), rel=1e-6)


def test_alpha_and_holes_have_no_gradient(device):
    given = on(device, bumps_with_normals(20, 30))
    alpha, depth = given["alpha"].requires_grad_(), given["depth"].requires_grad_()
    normal_consistency(**given).backward()
    assert alpha.grad is None
    assert not depth.grad[depth == 0].any()


@pytest.mark.parametrize(
    "name", ["ssim", "l1_dssim, lambda 0.2", "smoothness", "depth_to_normal", "normal_consistency"]
)
def test_images_have_a_pixel(name):
    given = OPERATIONS[name].inputs(*OPERATIONS[name].small)
    none = {argument: x if argument in ("viewmat", "K") else x[:0] for argument, x in given.items()}
    refused(lambda: OPERATIONS[name].native(**none), "image: ")
    refused(lambda: l1_dssim(**pair(4, 5, 3), lambda_dssim=1.5), "lambda_dssim: ")
