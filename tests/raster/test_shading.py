"""Blinn-Phong and spherical harmonics against their definitions, in value and every gradient."""

import math
from functools import partial

import pytest
import torch
from torch.nn.functional import normalize

from tests.raster.threads import require_same_bits
from tests.volume.march import shade
from texgs.core.camera import orbit_direction
from texgs.core.errors import ArgumentError, ShapeError
from texgs.core.geometry import quats_to_matrices
from texgs.raster.reference import shading as definition
from texgs.raster.shading import blinn_phong, blinn_phong_texture, spherical_harmonics
from texgs.volume.render import Appearance

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


def gradients(function, leaves, *constants, **options):
    """Outputs of a function, and the gradients of their sum under fixed weights."""
    leaves = [x.detach().requires_grad_() for x in leaves]
    outputs = function(*leaves, *constants, **options)
    outputs = outputs if isinstance(outputs, tuple) else (outputs,)
    weights = [torch.linspace(-1, 2, x.numel()).reshape(x.shape).to(x) for x in outputs]
    total = sum((w * x).sum() for w, x in zip(weights, outputs, strict=True))
    return [x.detach() for x in outputs], torch.autograd.grad(total, leaves)


def assert_close(values, expected, tolerance):
    """Equal within a part of the length, tensor by tensor."""
    for one, other in zip(values, expected, strict=True):
        assert (one - other).norm() <= tolerance * other.norm() + 1e-30  # below, float32 ends


@pytest.fixture(params=[False, True], ids=["both faces", "facing"])
def facing(request):
    """Which faces of the surfels are lit."""
    return request.param


def seen_from(device, light):
    """Camera position and light."""
    return CAMERA.to(device), None if LIGHTS[light] is None else LIGHTS[light].to(device)


@pytest.mark.parametrize("light", LIGHTS)
@pytest.mark.parametrize("shared", [(), ("shininess", "specular"), MATERIAL])
@pytest.mark.parametrize("n", [1, 17, 3001])
def test_blinn_phong(n, shared, light, facing, device):
    leaves = surfels(n, shared, device)
    constants = seen_from(device, light)
    exact = [None if x is None else x.double() for x in constants]
    doubles = [x.double() for x in leaves]
    values, derivatives = gradients(blinn_phong_texture, leaves, *constants, facing=facing)
    expected_values, expected = gradients(definition.blinn_phong_texture, doubles, *exact, facing=facing)
    assert_close(values, expected_values, 2e-6)
    # A power of 40 amplifies the rounding of its base and of log2 as much.
    assert_close(derivatives, expected, 1e-5)
    values, derivatives = gradients(blinn_phong, leaves, *constants, facing=facing)
    expected_values, expected = gradients(definition.blinn_phong, doubles, *exact, facing=facing)
    assert_close(values, expected_values, 2e-6)
    assert_close(derivatives, expected, 1e-5)


@pytest.mark.parametrize("light", LIGHTS)
def test_definition_of_blinn_phong_by_finite_differences(light, facing):
    leaves = [x.double().requires_grad_() for x in surfels(12)]
    constants = [None if x is None else x.double() for x in (CAMERA, LIGHTS[light])]
    shaded = partial(definition.blinn_phong_texture, facing=facing)
    assert torch.autograd.gradcheck(lambda *x: shaded(*x, *constants), leaves)


@pytest.mark.parametrize("light", LIGHTS)
def test_facing_is_the_light_of_volume_renderers(light, device):
    look = Appearance(ambient=0.2, diffuse=0.6, specular=0.4, shininess=12.0)
    material = [torch.full((1,), getattr(look, name), device=device) for name in MATERIAL]
    color, *_, quats = surfels(500, device=device)
    means = torch.zeros_like(color)  # in one place, as a distant viewer is in one direction
    shaded = blinn_phong(color, *material, means, quats, *seen_from(device, light), facing=True)
    to_viewer = normalize(CAMERA.double(), dim=0)
    to_light = to_viewer if LIGHTS[light] is None else normalize(LIGHTS[light].double(), dim=0)
    normal = quats_to_matrices(quats.cpu().double())[:, :, 2]
    expected = shade(color.cpu().double(), normal, to_viewer, to_light, look)
    torch.testing.assert_close(shaded.clamp(0, 1).cpu().double(), expected, atol=2e-6, rtol=0)


@pytest.mark.parametrize("shininess", [0.0, 0.5, 20.0])
def test_light_behind_the_face_that_the_camera_sees_leaves_ambient_light(shininess, device):
    color, *material, means, _ = surfels(40, MATERIAL, device)
    material[3] = torch.full_like(material[3], shininess)
    quats = torch.tensor([[1.0, 0, 0, 0], [0, 1.0, 0, 0]], device=device).repeat(20, 1)  # normals z and -z
    light = torch.tensor([0.3, 0.2, -1.0], device=device)
    leaves = [color, *material, means, quats]
    (shaded, gain), derivatives = gradients(
        blinn_phong_texture, leaves, CAMERA.to(device), light, facing=True
    )
    assert torch.equal(gain, material[0].expand(40))
    assert torch.equal(shaded, material[0] * color)
    assert [bool(x.any()) for x in derivatives] == [True, True, False, False, False, False, False]
    _, both = gradients(blinn_phong_texture, leaves, CAMERA.to(device), light)
    assert all(x.any() for x in both[:5])


def test_facing_changes_nothing_for_a_headlight(device):
    leaves = surfels(3001, ("diffuse",), device)
    values, derivatives = gradients(blinn_phong_texture, leaves, CAMERA.to(device), facing=True)
    expected_values, expected = gradients(blinn_phong_texture, leaves, CAMERA.to(device))
    pairs = zip((*values, *derivatives), (*expected_values, *expected), strict=True)
    assert all(torch.equal(one, other) for one, other in pairs)


@pytest.mark.parametrize("light", LIGHTS)
def test_surfels_have_no_front(light, facing, device):
    *leaves, quats = surfels(3001, ("specular",), device)
    constants = seen_from(device, light)

    def turned(q):
        """By 180 degrees about the first tangent: times the quaternion i."""
        w, x, y, z = q.unbind(-1)
        return torch.stack([-x, w, z, -y], -1)

    expected_values, expected = gradients(blinn_phong_texture, [*leaves, quats], *constants, facing=facing)
    values, derivatives = gradients(blinn_phong_texture, [*leaves, turned(quats)], *constants, facing=facing)
    assert_close(values, expected_values, 2e-6)
    assert_close(derivatives, [*expected[:-1], turned(expected[-1])], 1e-5)


def test_a_surfel_that_faces_the_headlight(facing, device):
    one = torch.ones(1, device=device)
    color = torch.tensor([[0.2, 0.4, 0.6]], device=device)
    means, quats = torch.zeros(1, 3, device=device), torch.tensor([[2.0, 0, 0, 0]], device=device)
    camera = torch.tensor([0.0, 0.0, 5.0], device=device)
    surfel = (color, 0.3 * one, 0.5 * one, 0.1 * one, 20 * one, means, quats)
    shaded, gain = blinn_phong_texture(*surfel, camera, facing=facing)
    torch.testing.assert_close(gain, 0.8 * one)
    torch.testing.assert_close(shaded, 0.8 * color + 0.1)
    # The light 60 degrees off the normal: n.l = cos 60, n.h = cos 30.
    light = torch.tensor([math.sqrt(3), 0.0, 1.0], device=device)
    shaded = blinn_phong(*surfel, camera, light, facing=facing)
    torch.testing.assert_close(shaded, 0.55 * color + 0.1 * 0.75**10)


def test_textured_fragment_is_affine_in_the_texel(facing, device):
    color, *rest = surfels(50, device=device)
    rest += seen_from(device, "directional")
    base, gain = blinn_phong_texture(color, *rest, facing=facing)
    texel = torch.rand(50, 3, device=device)
    expected = blinn_phong(color + texel, *rest, facing=facing)
    torch.testing.assert_close(base + gain[:, None] * texel, expected)


def test_grazing_and_opposite_directions_stay_finite(facing, device):
    color, *material, means, _ = surfels(2, device=device)
    means = torch.tensor([[0.0, 0, 0], [0.0, 0, 3]], device=device)  # the second sits in the camera
    quats = torch.tensor([[0.5, 0.5, 0.5, 0.5], [1.0, 0, 0, 0]], device=device)  # normals +x and +z
    camera = torch.tensor([0.0, 0.0, 3.0], device=device)
    for light in (None, torch.tensor([0.0, 0.0, -1.0], device=device)):  # no light, and straight from behind
        leaves = [color, *material, means, quats]
        values, derivatives = gradients(blinn_phong_texture, leaves, camera, light, facing=facing)
        assert all(x.isfinite().all() for x in (*values, *derivatives))


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
@pytest.mark.parametrize("n", [1, 17, 3001])
def test_spherical_harmonics(n, degree, device):
    generator = torch.Generator().manual_seed(n + degree)
    sh = torch.randn(n, (degree + 1) ** 2, 3, generator=generator).to(device)
    means = torch.randn(n, 3, generator=generator).to(device)
    camera = CAMERA.to(device)
    values, derivatives = gradients(spherical_harmonics, [sh, means], camera)
    expected_values, expected = gradients(
        definition.spherical_harmonics, [sh.double(), means.double()], camera.double()
    )
    assert_close(values, expected_values, 1e-6)
    assert_close(derivatives, expected, 2e-6)


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
def test_any_number_of_threads_gives_the_same_bits(light, facing):
    leaves = surfels(5000, ("diffuse", "shininess"))
    sh = [torch.rand(5000, 16, 3), leaves[5]]

    def everything():
        values, derivatives = gradients(blinn_phong_texture, leaves, CAMERA, LIGHTS[light], facing=facing)
        colors, by_sh = gradients(spherical_harmonics, sh, CAMERA)
        return [*values, *derivatives, *colors, *by_sh]

    require_same_bits(everything)


def test_a_shininess_that_is_not_finite_is_seen(device):
    color, ambient, diffuse, specular, _, means, quats = surfels(3, device=device)
    shininess = torch.tensor([5.0, float("nan"), 5.0], device=device)
    lit = blinn_phong(color, ambient, diffuse, specular, shininess, means, quats, CAMERA.to(device))
    assert lit.isnan().any(1).tolist() == [False, True, False]


def test_no_surfels(device):
    values, derivatives = gradients(blinn_phong_texture, surfels(0, ("ambient",), device), CAMERA.to(device))
    assert [len(x) for x in values] == [0, 0]
    assert [len(x) for x in derivatives] == [0, 1, 0, 0, 0, 0, 0]
    assert not derivatives[1].any()
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
