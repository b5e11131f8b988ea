"""Blinn-Phong and spherical harmonics against their definitions, in value and every gradient."""

import math

import pytest
import torch

from tests.raster.threads import with_threads
from texgs.core.camera import orbit_direction
from texgs.core.errors import ArgumentError, ShapeError
from texgs.raster.reference import shading as definition
from texgs.raster.shading import blinn_phong, blinn_phong_texture
from texgs.raster.spherical_harmonics import spherical_harmonics

CAMERA = torch.tensor([0.5, 1.0, 3.0])
MATERIAL = ("ambient", "diffuse", "specular", "shininess")
LIGHTS = {"headlight": None, "directional": 2.5 * orbit_direction(30, 50).float()}


def surfels(n, shared=(), device="cpu"):
    """Colour, material, means and quats of n surfels; parameters in `shared` are one for all."""
    generator = torch.Generator().manual_seed(n)

    def uniform(low, high, *size):
        return (low + (high - low) * torch.rand(*size, generator=generator)).to(device)

    ranges = {"ambient": (0.1, 0.6), "diffuse": (0.2, 0.9), "specular": (0.1, 0.9), "shininess": (1.5, 40.0)}
    material = [uniform(*limits, 1 if name in shared else n) for name, limits in ranges.items()]
    return [uniform(0, 1, n, 3), *material, uniform(-0.5, 0.5, n, 3), uniform(-1, 1, n, 4)]


def gradients(function, leaves, *constants):
    """Outputs of a function, and the gradients of their sum under fixed weights."""
    leaves = [x.detach().requires_grad_() for x in leaves]
    outputs = function(*leaves, *constants)
    outputs = outputs if isinstance(outputs, tuple) else (outputs,)
    weights = [torch.linspace(-1, 2, x.numel()).reshape(x.shape).to(x) for x in outputs]
    total = sum((w * x).sum() for w, x in zip(weights, outputs, strict=True))
    return [x.detach() for x in outputs], torch.autograd.grad(total, leaves)


def assert_close(found, expected, tolerance):
    """Equal within a part of the length, tensor by tensor."""
    for one, other in zip(found, expected, strict=True):
        assert (one - other).norm() <= tolerance * other.norm() + 1e-30  # below, float32 ends


@pytest.mark.parametrize("light", LIGHTS)
@pytest.mark.parametrize("shared", [(), ("shininess", "specular"), MATERIAL])
@pytest.mark.parametrize("n", [1, 17, 3001])
def test_blinn_phong(n, shared, light, device):
    leaves = surfels(n, shared, device)
    constants = [CAMERA.to(device), None if LIGHTS[light] is None else LIGHTS[light].to(device)]
    exact = [None if x is None else x.double() for x in constants]
    doubles = [x.double() for x in leaves]
    values, found = gradients(blinn_phong_texture, leaves, *constants)
    expected_values, expected = gradients(definition.blinn_phong_texture, doubles, *exact)
    assert_close(values, expected_values, 2e-6)
    # A power of 40 amplifies the rounding of its base and of log2 as much.
    assert_close(found, expected, 1e-5)
    values, found = gradients(blinn_phong, leaves, *constants)
    expected_values, expected = gradients(definition.blinn_phong, doubles, *exact)
    assert_close(values, expected_values, 2e-6)
    assert_close(found, expected, 1e-5)


@pytest.mark.parametrize("light", LIGHTS)
def test_definition_of_blinn_phong_by_finite_differences(light):
    leaves = [x.double().requires_grad_() for x in surfels(5)]
    constants = [None if x is None else x.double() for x in (CAMERA, LIGHTS[light])]
    assert torch.autograd.gradcheck(lambda *x: definition.blinn_phong_texture(*x, *constants), leaves)


def test_a_surfel_that_faces_the_headlight(device):
    one = torch.ones(1, device=device)
    color = torch.tensor([[0.2, 0.4, 0.6]], device=device)
    means, quats = torch.zeros(1, 3, device=device), torch.tensor([[2.0, 0, 0, 0]], device=device)
    camera = torch.tensor([0.0, 0.0, 5.0], device=device)
    shaded, gain = blinn_phong_texture(color, 0.3 * one, 0.5 * one, 0.1 * one, 20 * one, means, quats, camera)
    torch.testing.assert_close(gain, 0.8 * one)
    torch.testing.assert_close(shaded, 0.8 * color + 0.1)
    # The light 60 degrees off the normal: n.l = cos 60, n.h = cos 30.
    light = torch.tensor([math.sqrt(3), 0.0, 1.0], device=device)
    shaded = blinn_phong(color, 0.3 * one, 0.5 * one, 0.1 * one, 20 * one, means, quats, camera, light)
    torch.testing.assert_close(shaded, 0.55 * color + 0.1 * 0.75**10)


def test_textured_fragment_is_affine_in_the_texel(device):
    color, *rest = surfels(50, device=device)
    camera = CAMERA.to(device)
    base, gain = blinn_phong_texture(color, *rest, camera)
    texel = torch.rand(50, 3, device=device)
    torch.testing.assert_close(base + gain[:, None] * texel, blinn_phong(color + texel, *rest, camera))


def test_grazing_and_opposite_directions_stay_finite(device):
    color, *material, means, _ = surfels(2, device=device)
    means = torch.tensor([[0.0, 0, 0], [0.0, 0, 3]], device=device)  # the second sits in the camera
    quats = torch.tensor([[0.5, 0.5, 0.5, 0.5], [1.0, 0, 0, 0]], device=device)  # normals +x and +z
    camera = torch.tensor([0.0, 0.0, 3.0], device=device)
    for light in (None, torch.tensor([0.0, 0.0, -1.0], device=device)):  # no light, and straight from behind
        values, found = gradients(blinn_phong_texture, [color, *material, means, quats], camera, light)
        assert all(x.isfinite().all() for x in (*values, *found))


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
@pytest.mark.parametrize("n", [1, 17, 3001])
def test_spherical_harmonics(n, degree, device):
    generator = torch.Generator().manual_seed(n + degree)
    sh = torch.randn(n, (degree + 1) ** 2, 3, generator=generator).to(device)
    means = torch.randn(n, 3, generator=generator).to(device)
    camera = CAMERA.to(device)
    values, found = gradients(spherical_harmonics, [sh, means], camera)
    expected_values, expected = gradients(
        definition.spherical_harmonics, [sh.double(), means.double()], camera.double()
    )
    assert_close(values, expected_values, 1e-6)
    assert_close(found, expected, 2e-6)


def test_definition_of_spherical_harmonics_by_finite_differences():
    torch.manual_seed(0)
    sh, means = 0.1 * torch.randn(4, 16, 3).double(), torch.randn(4, 3).double()
    assert torch.autograd.gradcheck(
        lambda *x: definition.spherical_harmonics(*x, CAMERA.double()),
        (sh.requires_grad_(), means.requires_grad_()),
    )


def test_harmonics_are_orthonormal():
    n = 200_000  # points of a Fibonacci lattice cover the sphere evenly
    k = torch.arange(n).double() + 0.5
    z, azimuth = 1 - 2 * k / n, math.pi * (1 + math.sqrt(5)) * k
    r = (1 - z * z).sqrt()
    basis = definition.harmonics(torch.stack([r * azimuth.cos(), r * azimuth.sin(), z], -1))
    torch.testing.assert_close(4 * math.pi * basis.T @ basis / n, torch.eye(16).double(), atol=1e-6, rtol=0)


def test_clamped_colours_have_no_gradient(device):
    sh = torch.tensor([[[-5.0, 0.1, 3.0]]], device=device)
    color, (by_sh, by_means) = gradients(
        spherical_harmonics, [sh, torch.ones(1, 3, device=device)], CAMERA.to(device)
    )
    assert color[0][0, 0] == 0
    assert by_sh[0, 0, 0] == 0
    assert by_sh[0, 0, 2] != 0
    assert not by_means.any()


@pytest.mark.parametrize("light", LIGHTS)
def test_any_number_of_threads_gives_the_same_bits(light):
    leaves = surfels(5000, ("diffuse", "shininess"))
    sh = [torch.rand(5000, 16, 3), leaves[5]]

    def everything():
        values, found = gradients(blinn_phong_texture, leaves, CAMERA, LIGHTS[light])
        colors, by_sh = gradients(spherical_harmonics, sh, CAMERA)
        return [*values, *found, *colors, *by_sh]

    expected = with_threads(1, everything)
    for n in (2, 7):
        assert all(torch.equal(a, b) for a, b in zip(with_threads(n, everything), expected, strict=True))


def test_no_surfels(device):
    values, found = gradients(blinn_phong_texture, surfels(0, ("ambient",), device), CAMERA.to(device))
    assert [len(x) for x in values] == [0, 0]
    assert [len(x) for x in found] == [0, 1, 0, 0, 0, 0, 0]
    assert not found[1].any()
    assert spherical_harmonics(torch.zeros(0, 4, 3, device=device), values[0], CAMERA.to(device)).shape == (
        0,
        3,
    )


def test_errors_name_the_argument():
    color, *material, means, quats = surfels(6)
    with pytest.raises(ShapeError, match=r"ambient: expected \[6\] or one for all \[1\], got \[5\]"):
        blinn_phong(color, material[0][:5], *material[1:], means, quats, CAMERA)
    with pytest.raises(ShapeError, match=r"quats: expected \[6, 4\], got \[4, 6\]; did you transpose"):
        blinn_phong(color, *material, means, quats.T, CAMERA)
    with pytest.raises(ShapeError, match=r"light: expected \[3\], got \[1, 3\]"):
        blinn_phong(color, *material, means, quats, CAMERA, CAMERA[None])
    with pytest.raises(ArgumentError, match="light: expected float32, got float64"):
        blinn_phong(color, *material, means, quats, CAMERA, orbit_direction(0, 0))
    with pytest.raises(ArgumentError, match="camera_position: not differentiable here"):
        blinn_phong(color, *material, means, quats, CAMERA.clone().requires_grad_())
    with pytest.raises(ShapeError, match="sh: expected 1, 4, 9 or 16 coefficients"):
        spherical_harmonics(torch.zeros(6, 5, 3), means, CAMERA)
