"""Blinn-Phong and spherical harmonics: closed forms, symmetries, and what has no direction."""

import math
from functools import partial

import pytest
import torch
from torch.nn.functional import normalize

from tests.raster.operations import CAMERA, LIGHTS, evaluate, surfels
from tests.refusals import refused
from tests.volume.march import shade
from texgs.core.errors import ShapeError
from texgs.core.geometry import quats_to_matrices
from texgs.raster.reference import shading as definition
from texgs.raster.shading import MATERIAL, blinn_phong, spherical_harmonics
from texgs.volume.render import Appearance

LEAVES = ("color", *MATERIAL, "means", "quats")


def placed(device, *size, **settings):
    """Return surfels on a device, by name."""
    return {name: x.to(device) for name, x in surfels(*size, **settings).items()}


def gradients(given, **settings):
    """Return base and gain, and the gradients of all leaves."""
    return evaluate(partial(blinn_phong, **settings), given, LEAVES)


def assert_close(values, expected, tolerance):
    """Equal within a part of the length, tensor by tensor."""
    for one, other in zip(values, expected, strict=True):
        assert (one - other).norm() <= tolerance * other.norm() + 1e-30  # below, float32 ends


@pytest.fixture(params=[False, True], ids=["both faces", "facing"])
def facing(request):
    """Which faces of the surfels are lit."""
    return request.param


@pytest.mark.parametrize("light", LIGHTS)
def test_facing_is_the_light_of_volume_renderers(light, device):
    look = Appearance(ambient=0.2, diffuse=0.6, specular=0.4, shininess=12.0)
    given = placed(device, 500, light=light)
    given |= {name: torch.full((1,), getattr(look, name), device=device) for name in MATERIAL}
    given["means"] = torch.zeros_like(given["color"])  # in one place: a distant viewer is in one direction
    shaded, _ = blinn_phong(**given, facing=True)
    to_viewer = normalize(CAMERA.double(), dim=0)
    to_light = to_viewer if LIGHTS[light] is None else normalize(LIGHTS[light].double(), dim=0)
    normal = quats_to_matrices(given["quats"].cpu().double())[:, :, 2]
    expected = shade(given["color"].cpu().double(), normal, to_viewer, to_light, look)
    torch.testing.assert_close(shaded.clamp(0, 1).cpu().double(), expected, atol=2e-6, rtol=0)


@pytest.mark.parametrize("shininess", [0.0, 0.5, 20.0])
def test_light_behind_the_face_that_the_camera_sees_leaves_ambient_light(shininess, device):
    given = placed(device, 40, MATERIAL)
    given["shininess"] = torch.full_like(given["shininess"], shininess)
    # normals z and -z
    given["quats"] = torch.tensor([[1.0, 0, 0, 0], [0, 1.0, 0, 0]], device=device).repeat(20, 1)
    given["light"] = torch.tensor([0.3, 0.2, -1.0], device=device)
    (shaded, gain), derivatives = gradients(given, facing=True)
    assert torch.equal(gain, given["ambient"].expand(40))
    assert torch.equal(shaded, given["ambient"] * given["color"])
    assert [bool(x.any()) for x in derivatives] == [True, True, False, False, False, False, False]
    assert all(x.any() for x in gradients(given)[1][:5])


@pytest.mark.parametrize("light", LIGHTS)
def test_surfels_have_no_front(light, facing, device):
    given = placed(device, 3001, ("specular",), light=light)

    def turned(q):
        """Turn by 180 degrees about the first tangent: times the quaternion i."""
        w, x, y, z = q.unbind(-1)
        return torch.stack([-x, w, z, -y], -1)

    expected_values, expected = gradients(given, facing=facing)
    values, derivatives = gradients(given | {"quats": turned(given["quats"])}, facing=facing)
    assert_close(values, expected_values, 2e-6)
    assert_close(derivatives, [*expected[:-1], turned(expected[-1])], 1e-5)


def one_surfel(device):
    """Return a surfel that faces a camera on its axis."""
    given = {"color": torch.tensor([[0.2, 0.4, 0.6]])}
    given |= {name: torch.tensor([x]) for name, x in zip(MATERIAL, (0.3, 0.5, 0.1, 20.0), strict=True)}
    given |= {"means": torch.zeros(1, 3), "quats": torch.tensor([[2.0, 0, 0, 0]])}
    given |= {"camera_position": torch.tensor([0.0, 0.0, 5.0])}
    return {name: x.to(device) for name, x in given.items()}


def test_a_surfel_that_faces_the_headlight(facing, device):
    given = one_surfel(device)
    shaded, gain = blinn_phong(**given, facing=facing)
    torch.testing.assert_close(gain.cpu(), torch.tensor([0.8]))
    torch.testing.assert_close(shaded, 0.8 * given["color"] + 0.1)
    # The light 60 degrees off the normal: n.l = cos 60, n.h = cos 30.
    light = torch.tensor([math.sqrt(3), 0.0, 1.0], device=device)
    shaded, _ = blinn_phong(**given, light=light, facing=facing)
    torch.testing.assert_close(shaded, 0.55 * given["color"] + 0.1 * 0.75**10)


def test_textured_fragment_is_affine_in_the_texel(facing, device):
    given = placed(device, 50, light="directional")
    base, gain = blinn_phong(**given, facing=facing)
    texel = torch.rand(50, 3, device=device)
    expected, _ = blinn_phong(**given | {"color": given["color"] + texel}, facing=facing)
    torch.testing.assert_close(base + gain[:, None] * texel, expected)


def test_grazing_and_opposite_directions_stay_finite(facing, device):
    given = placed(device, 2)
    given["means"] = torch.tensor([[0.0, 0, 0], [0.0, 0, 3]], device=device)  # the second is in the camera
    # normals +x and +z
    given["quats"] = torch.tensor([[0.5, 0.5, 0.5, 0.5], [1.0, 0, 0, 0]], device=device)
    given["camera_position"] = torch.tensor([0.0, 0.0, 3.0], device=device)
    for light in (None, torch.tensor([0.0, 0.0, -1.0], device=device)):  # no light, and straight from behind
        values, derivatives = gradients(given | {"light": light}, facing=facing)
        assert all(x.isfinite().all() for x in (*values, *derivatives))


def test_harmonics_are_orthonormal():
    n = 200_000  # points of a Fibonacci lattice cover the sphere evenly
    k = torch.arange(n).double() + 0.5
    z, azimuth = 1 - 2 * k / n, math.pi * (1 + math.sqrt(5)) * k
    r = (1 - z * z).sqrt()
    basis = definition.harmonics(torch.stack([r * azimuth.cos(), r * azimuth.sin(), z], -1))
    torch.testing.assert_close(4 * math.pi * basis.T @ basis / n, torch.eye(16).double(), atol=1e-6, rtol=0)


def test_clamped_colours_have_no_gradient(device):
    given = {"sh": torch.tensor([[[-5.0, 0.1, 3.0]]]), "means": torch.ones(1, 3), "camera_position": CAMERA}
    given = {name: x.to(device) for name, x in given.items()}
    (color,), (by_sh, by_means) = evaluate(spherical_harmonics, given, ("sh", "means"))
    assert color[0, 0] == 0
    assert by_sh[0, 0, 0] == 0
    assert by_sh[0, 0, 2] != 0
    assert not by_means.any()


def test_a_shininess_that_is_not_finite_is_seen(device):
    shininess = torch.tensor([5.0, float("nan"), 5.0], device=device)
    lit, _ = blinn_phong(**placed(device, 3) | {"shininess": shininess})
    assert lit.isnan().any(1).tolist() == [False, True, False]


def test_no_surfels(device):
    values, derivatives = gradients(placed(device, 0, ("ambient",)))
    assert [len(x) for x in values] == [0, 0]
    assert [len(x) for x in derivatives] == [0, 1, 0, 0, 0, 0, 0]
    assert not derivatives[1].any()
    none = torch.zeros(0, 4, 3, device=device)
    assert spherical_harmonics(none, values[0], CAMERA.to(device)).shape == (0, 3)


def test_numbers_of_parameters_and_coefficients():
    given = surfels(6)
    fewer, sh = given | {"ambient": given["ambient"][:5]}, torch.zeros(6, 5, 3)
    refused(lambda: blinn_phong(**fewer), "ambient: ", ShapeError)
    refused(lambda: spherical_harmonics(sh, given["means"], CAMERA), "sh: ", ShapeError)
