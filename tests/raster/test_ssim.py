"""SSIM and L1 + D-SSIM against their definition, in value and gradient."""

import numpy as np
import pytest
import torch

from tests.raster.agreement import evaluate
from tests.raster.threads import require_same_bits
from texgs.core.errors import ArgumentError, DeviceError, ShapeError
from texgs.raster.losses import l1_dssim, ssim
from texgs.raster.reference import losses as definition

SIZES = [(1, 1, 3), (33, 7, 1), (7, 33, 4), (150, 300, 3), (359, 641, 1)]
ONES = torch.ones(4, 5, 3)
TOLERANCE = 1e-5  # relative; variances cancel in float32, where plain torch reaches 4e-5


def pair(height, width, channels, device="cpu", noise=0.1):
    """Planar images in [0, 1]: a smooth target, and the target with noise."""
    generator = torch.Generator().manual_seed(height * width)
    y, x = torch.meshgrid(torch.linspace(0, 3, height), torch.linspace(0, 4, width), indexing="ij")
    target = torch.stack([0.5 + 0.5 * torch.sin(x * (c + 1) + y * y) for c in range(channels)])
    image = (target + noise * torch.randn(target.shape, generator=generator)).clamp(0, 1)
    return image.permute(1, 2, 0).to(device), target.permute(1, 2, 0).to(device)


def distance(gradient, expected):
    """Of two gradients, relative to the length of the second."""
    return ((gradient - expected).norm() / expected.norm()).item()


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("lambda_dssim", [0.0, 0.2, 1.0])
def test_value_and_gradient(size, lambda_dssim, device):
    image, target = pair(*size, device)
    value, gradient = evaluate(lambda x, y: l1_dssim(x, y, lambda_dssim), image, target)
    expected, expected_gradient = evaluate(
        lambda x, y: definition.l1_dssim(x, y, lambda_dssim), image.double(), target.double()
    )
    assert value.item() == pytest.approx(expected.item(), rel=TOLERANCE)
    assert distance(gradient, expected_gradient) < TOLERANCE


def test_ssim_is_the_definition(device):
    image, target = pair(45, 70, 3, device)
    value, gradient = evaluate(ssim, image, target)
    expected, expected_gradient = evaluate(definition.ssim, image.double(), target.double())
    assert value.item() == pytest.approx(expected.item(), rel=1e-6)
    assert distance(gradient, expected_gradient) < TOLERANCE


def test_definition_by_finite_differences():
    image, target = pair(5, 6, 2)
    assert torch.autograd.gradcheck(
        lambda x: definition.l1_dssim(x, target.double()), image.double().requires_grad_()
    )


def test_definition_window_by_window():
    """Wang et al. 2004, written out: 11 x 11 Gaussian windows, zeros outside of the image."""
    image, target = (x[..., 0].double().numpy() for x in pair(9, 14, 1))
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
    _, target = pair(*size, device)
    value, gradient = evaluate(l1_dssim, target.clone(), target)
    assert ssim(target, target).item() == 1
    assert value.item() == 0
    assert not gradient.any()


@pytest.mark.parametrize("box", [(0, 3, 0, 5), (100, 140, 250, 262), (149, 150, 299, 300), (20, 21, 0, 300)])
def test_skipping_equal_windows_changes_nothing(box, device):
    top, bottom, left, right = box
    noisy, target = pair(150, 300, 3, device)
    image = target.clone()
    image[top:bottom, left:right] = noisy[top:bottom, left:right]
    value, gradient = evaluate(l1_dssim, image, target)
    expected, expected_gradient = evaluate(definition.l1_dssim, image.double(), target.double())
    assert value.item() == pytest.approx(expected.item(), rel=TOLERANCE)
    assert distance(gradient, expected_gradient) < TOLERANCE
    reach = 10  # two window radii
    outside = torch.ones(150, 300, dtype=torch.bool)
    outside[max(top - reach, 0) : bottom + reach, max(left - reach, 0) : right + reach] = False
    assert not gradient[outside].any()


def test_memory_layouts_agree(device):
    image, target = pair(40, 50, 3, device)
    expected = evaluate(l1_dssim, image, target)
    for other in (image.contiguous(), image.repeat(1, 2, 1)[:, :50], image.flip(0).flip(0)):
        value, gradient = evaluate(l1_dssim, other, target.contiguous())
        assert value == expected[0]
        assert torch.equal(gradient, expected[1])


def test_one_plane(device):
    image, target = pair(40, 50, 1, device)
    value, gradient = evaluate(l1_dssim, image[..., 0], target[..., 0])
    expected, expected_gradient = evaluate(l1_dssim, image, target)
    assert value == expected
    assert torch.equal(gradient, expected_gradient[..., 0])


def test_weight_of_the_loss_scales_the_gradient(device):
    image, target = pair(20, 30, 3, device)
    _, gradient = evaluate(l1_dssim, image, target)
    _, scaled = evaluate(lambda x, y: 0.25 * l1_dssim(x, y), image, target)
    assert torch.equal(scaled, 0.25 * gradient)


def test_a_retained_graph_can_be_used_again(device):
    image, target = pair(20, 30, 3, device)
    _, gradient = evaluate(l1_dssim, image, target)
    image = image.detach().requires_grad_()
    value = l1_dssim(image, target)
    for _ in range(3):
        value.backward(retain_graph=True)
    torch.testing.assert_close(image.grad, 3 * gradient)


def test_a_retained_graph_cannot_be_used_after_its_target_has_changed(device):
    image, target = pair(20, 30, 3, device)
    target = target.permute(2, 0, 1).contiguous().permute(1, 2, 0)  # planar memory is not copied
    value = l1_dssim(image.requires_grad_(), target)
    value.backward(retain_graph=True)
    target.zero_()
    with pytest.raises(RuntimeError, match="modified by an inplace operation"):
        value.backward()


def test_value_does_not_depend_on_the_gradient(device):
    image, target = pair(150, 300, 3, device)
    assert l1_dssim(image, target) == evaluate(l1_dssim, image, target)[0]


def test_nan_is_not_skipped(device):
    image, target = pair(40, 50, 3, device)
    image = image.clone()
    image[20, 20, 1] = float("nan")
    assert ssim(image, target).isnan()


def test_any_number_of_threads_gives_the_same_bits():
    require_same_bits(evaluate, l1_dssim, *pair(359, 641, 3))


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ((ONES, ONES.transpose(0, 1)), ShapeError, r"target: expected \[4, 5, 3\], got \[5, 4, 3\]"),
        ((ONES[0, 0], ONES[0, 0]), ShapeError, r"image: expected \[H, W, C\], got \[3\]"),
        ((ONES[:0], ONES[:0]), ArgumentError, "image: expected at least one pixel"),
        ((ONES.double(), ONES), ArgumentError, "image: expected float32, got float64"),
        ((ONES, ONES.half()), ArgumentError, "target: expected float32, got float16"),
        ((ONES, ONES, 1.5), ArgumentError, "lambda_dssim: expected 0 to 1, got 1.5"),
        ((ONES, ONES.clone().requires_grad_()), ArgumentError, r"target: .* target.detach\(\)"),
        ((ONES, ONES.to("meta")), DeviceError, "target: expected device cpu as image, got meta"),
    ],
)
def test_errors_name_the_argument(arguments, error, message):
    with pytest.raises(error, match=message):
        l1_dssim(*arguments)
