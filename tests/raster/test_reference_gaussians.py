"""The definition of 3D Gaussians against closed forms, numerical derivatives and sampled points."""

import pytest
import torch

from tests.raster.closed_form import CENTRE, FOCAL, HEIGHT, WIDTH, view
from texgs.core.geometry import quats_to_matrices
from texgs.raster.reference.gaussians import derivative, project
from texgs.raster.types import Options

SMOOTH = Options(alpha_min=0.0, transmittance_min=0.0)
NAMES = ("means", "quats", "scales", "opacities", "viewmat", "K")


def projected(options=SMOOTH, **gaussians):
    """What `project` makes of Gaussians before the unmoved camera."""
    arguments = view(**gaussians)
    return project(*(arguments[name] for name in NAMES), None, (WIDTH, HEIGHT), options)


def test_covariance_is_that_of_projected_points():
    """Of a small Gaussian, whose extent the perspective projection maps almost linearly."""
    quats, scales, mean = [[0.8, 0.3, 0.5, 0.1]], [[3e-3, 1e-3, 2e-3]], [[0.4, -0.3, 2.0]]
    covariance = projected(means=mean, quats=quats, scales=scales, opacities=[0.8]).covariance[0]
    normal = torch.randn(400_000, 3, generator=torch.Generator().manual_seed(0)).double()
    axes = quats_to_matrices(torch.tensor(quats).double())[0] * torch.tensor(scales).double()
    points = torch.tensor(mean).double() + normal @ axes.T
    pixels = FOCAL * points[:, :2] / points[:, 2:] + torch.tensor(CENTRE).double()
    # an estimate of n samples is off by sqrt(2 / n)
    torch.testing.assert_close(covariance - 0.3 * torch.eye(2), torch.cov(pixels.T), rtol=0.01, atol=1e-5)


def test_derivative_of_the_projection():
    K = view(means=[[0, 0, 2]])["K"]
    points = torch.tensor([[0.1, 0.2, 1.0], [-0.5, 0.3, 2.0], [0.4, -0.3, 1.1]]).double()
    expected = torch.func.vmap(torch.func.jacrev(lambda p: (K @ p)[:2] / p[2]))(points)
    torch.testing.assert_close(derivative(points, K, (WIDTH, HEIGHT)), expected)


@pytest.mark.parametrize("side", [-1, 1])
def test_derivative_far_outside_is_that_at_the_edge_of_a_wider_view(side):
    K = view(means=[[0, 0, 2]])["K"]
    # 1.3 tan(fov / 2), the view being centred
    edge = 1.3 * torch.tensor([WIDTH, HEIGHT]).double() / (2 * FOCAL)
    at_edge = torch.tensor([[side * edge[0], side * edge[1], 1.0]]).double()
    beyond = at_edge * torch.tensor([7.0, 3.0, 1.0]).double()
    size = (WIDTH, HEIGHT)
    torch.testing.assert_close(derivative(2 * beyond, K, size), derivative(2 * at_edge, K, size))


def test_view_around_another_point_reaches_as_far_as_its_edges():
    K = view(means=[[0, 0, 2]])["K"]
    K[:2, 2] = torch.tensor([3.0, 20.0])
    margin = 0.3 * WIDTH / (2 * FOCAL)
    for side, slope in ((-1, -3.0 / FOCAL - margin), (1, (WIDTH - 3.0) / FOCAL + margin)):
        J = derivative(torch.tensor([[9.0 * side, 0.0, 1.0]]).double(), K, (WIDTH, HEIGHT))
        assert J[0, 0, 2].item() == pytest.approx(-FOCAL * slope)


def test_antialiased_gaussians_keep_their_amount_of_light():
    """Opacity times area on screen is what it is without the dilation."""
    gaussian = {"means": [[0, 0, 2]], "scales": [[0.02, 0.04, 0.01]], "opacities": [0.6]}
    for dilation in (1e-6, 0.3, 1.0):
        projection = projected(Options(antialiased=True, dilation=dilation), **gaussian)
        amount = projection.opacity[0] * torch.linalg.det(projection.covariance[0]).sqrt()
        assert amount.item() == pytest.approx(0.6 * (FOCAL / 2) ** 2 * 0.02 * 0.04, rel=1e-3)
    point = projected(Options(antialiased=True), **gaussian | {"scales": [[1e-9, 1e-9, 1e-9]]})
    assert point.opacity.item() == pytest.approx(0.6 * 0.005)  # the least factor, as in 3DGS
