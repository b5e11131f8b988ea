"""Normals from depth and their consistency with blended normals, against the definition."""

import pytest
import torch
from torch.nn.functional import normalize

from tests.raster.threads import require_same_bits
from texgs.core.camera import orbit
from texgs.core.errors import ArgumentError, ShapeError
from texgs.raster.losses import depth_to_normal, normal_consistency
from texgs.raster.reference import losses as definition

SIZES = [(1, 1), (3, 3), (2, 40), (33, 7), (7, 33), (70, 130)]


def view(height, width, device="cpu"):
    """A camera from the side, and a bumpy surface with a hole in it."""
    camera = orbit(30, 20, 3.0, 40.0, width, height)
    generator = torch.Generator().manual_seed(height * width)
    y, x = torch.meshgrid(torch.linspace(0, 3, height), torch.linspace(0, 4, width), indexing="ij")
    depth = 2 + 0.3 * torch.sin(2 * x + y * y) + 0.01 * torch.rand(height, width, generator=generator)
    depth[height // 3 : height // 2, width // 3 : width // 2] = 0
    normal = normalize(torch.randn(height, width, 3, generator=generator), dim=-1)
    alpha = torch.rand(height, width, generator=generator)
    return [x.to(device) for x in (depth, normal, alpha, camera.viewmat, camera.K)]


def gradients(loss, *leaves):
    """Value of a loss of copies of the leaves, and its gradients."""
    leaves = [x.detach().requires_grad_() for x in leaves]
    value = loss(*leaves)
    value = value + sum(0 * x.sum() for x in leaves)  # images without inner pixels depend on nothing
    return value.detach(), torch.autograd.grad(value, leaves)


def assert_close(result, expected, tolerance=5e-6):
    """Equal within a part of the length; float32 differences of neighbouring depths lose one digit."""
    assert (result - expected).norm() <= tolerance * expected.norm()


@pytest.mark.parametrize("size", SIZES)
def test_normals_and_their_gradient(size, device):
    depth, weights, _, viewmat, K = view(*size, device)
    exact = (viewmat.double(), K.double())
    expected = definition.depth_to_normal(depth.double(), *exact)
    assert_close(depth_to_normal(depth, viewmat, K), expected)
    _, (gradient,) = gradients(lambda z: (weights * depth_to_normal(z, viewmat, K)).sum(), depth)
    _, (expected,) = gradients(
        lambda z: (weights.double() * definition.depth_to_normal(z, *exact)).sum(),
        depth.double(),
    )
    assert_close(gradient, expected)


@pytest.mark.parametrize("size", SIZES)
def test_consistency_and_its_gradients(size, device):
    depth, normal, alpha, viewmat, K = view(*size, device)
    value, derivatives = gradients(lambda n, z: normal_consistency(n, z, alpha, viewmat, K), normal, depth)
    constants = (alpha.double(), viewmat.double(), K.double())
    expected_value, expected = gradients(
        lambda n, z: definition.normal_consistency(n, z, *constants), normal.double(), depth.double()
    )
    assert value.item() == pytest.approx(expected_value.item(), rel=1e-6)
    for one, other in zip(derivatives, expected, strict=True):
        assert_close(one, other)


def test_definition_by_finite_differences():
    depth, normal, alpha, viewmat, K = (x.double() for x in view(6, 7))
    depth = depth.clamp_min(1)  # a hole is a step, which finite differences cannot cross
    assert torch.autograd.gradcheck(
        lambda n, z: definition.normal_consistency(n, z, alpha, viewmat, K),
        (normal.requires_grad_(), depth.requires_grad_()),
    )


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
    assert_close(normal[1:-1, 1:-1], towards_camera.expand(28, 38, 3), 1e-5)
    assert not normal[[0, -1]].any()
    assert not normal[:, [0, -1]].any()


def test_agreeing_normals_cost_what_alpha_leaves(device):
    depth, _, alpha, viewmat, K = view(20, 30, device)
    normal = depth_to_normal(depth, viewmat, K)
    known = (normal.norm(dim=-1) > 0.5).double()
    expected = 1 - (alpha.double() * known).mean()
    assert normal_consistency(normal, depth, alpha, viewmat, K).item() == pytest.approx(
        expected.item(), rel=1e-6
    )


def test_alpha_and_holes_have_no_gradient(device):
    depth, normal, alpha, viewmat, K = view(20, 30, device)
    alpha.requires_grad_()
    depth.requires_grad_()
    normal_consistency(normal, depth, alpha, viewmat, K).backward()
    assert alpha.grad is None
    assert not depth.grad[depth == 0].any()


def test_any_number_of_threads_gives_the_same_bits():
    depth, normal, alpha, viewmat, K = view(201, 97)

    def everything():
        value, derivatives = gradients(
            lambda n, z: normal_consistency(n, z, alpha, viewmat, K), normal, depth
        )
        _, (by_depth,) = gradients(lambda z: (normal * depth_to_normal(z, viewmat, K)).sum(), depth)
        return [value, *derivatives, by_depth]

    require_same_bits(everything)


def test_errors_name_the_argument():
    depth, normal, alpha, viewmat, K = view(4, 5)
    with pytest.raises(ShapeError, match=r"normal: expected \[4, 5, 3\], got \[5, 4, 3\]"):
        normal_consistency(normal.transpose(0, 1), depth, alpha, viewmat, K)
    with pytest.raises(ShapeError, match=r"alpha: expected \[4, 5\], got \[4, 5, 1\]; drop the last axis"):
        normal_consistency(normal, depth, alpha[..., None], viewmat, K)
    with pytest.raises(ArgumentError, match="depth: expected float32, got float64"):
        depth_to_normal(depth.double(), viewmat, K)
    with pytest.raises(ArgumentError, match="viewmat: not differentiable here"):
        depth_to_normal(depth, viewmat.requires_grad_(), K)
    with pytest.raises(ArgumentError, match="image: expected at least one pixel"):
        depth_to_normal(depth[:0], viewmat.detach(), K)
