import numpy as np
import pytest
import torch

from tests.fields.surfels.ply_files import vertices
from tests.fields.surfels.samples import sample
from tests.refusals import refused
from tests.scene.balls import shell
from texgs.core.lens import Lens
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.shading import ShadingModel
from texgs.raster import Render
from texgs.scene.mesh import depth_views, fuse, write_mesh
from texgs.volume.cameras import geodesic_vertices, icosphere
from texgs.volume.isosurface import Mesh

RADIUS, VOXEL = 0.4, 1 / 128
VIEWS = icosphere(2, Lens(4.0311, 30, 256, 256))  # pixels about as wide as a voxel
RED = torch.tensor([1.0, 0.25, 0.0])


def ball(opacity=8.0):
    """Opaque surfels side by side on a sphere, all of one colour."""
    normals = torch.from_numpy(geodesic_vertices(24)).float()
    sh = ((RED - 0.5) / 0.28209479).expand(len(normals), 1, 3).clone()
    return Surfels({**shell(normals, RADIUS, 0.01, opacity), "sh": sh}, ShadingModel())


def show(model):
    return lambda camera: model.render(camera, background=torch.zeros(3), outputs=("median",))


def exact(camera):
    """A sphere by ray casting, through pixel centres at +0.5."""
    u, v = torch.meshgrid(torch.arange(256) + 0.5, torch.arange(256) + 0.5, indexing="xy")
    rays = torch.stack([u, v, torch.ones_like(u)], dim=-1).double() @ camera.K.double().inverse().T
    middle = camera.viewmat[:3, 3].double()
    a, b, c = rays.square().sum(-1), rays @ middle, middle @ middle - RADIUS**2
    hit = b * b > a * c
    depth = torch.where(hit, (b - (b * b - a * c).clamp_min(0).sqrt()) / a, 0).float()
    return Render(hit[..., None] * RED, hit.float(), median=depth)


def signed_volume(mesh):
    """Positive where triangles turn left seen from outside."""
    a, b, c = mesh.vertices[mesh.triangles].transpose(1, 0, 2)
    return (np.cross(a, b) * c).sum() / 6


def centroid(mesh):
    """Of the surface; vertices are denser where it is aligned with the grid."""
    a, b, c = mesh.vertices[mesh.triangles].astype(np.float64).transpose(1, 0, 2)
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return (areas[:, None] * (a + b + c)).sum(0) / (3 * areas.sum())


def test_exact_depth_becomes_a_sphere():
    mesh = fuse(depth_views(exact, VIEWS), VOXEL)
    radii = np.linalg.norm(mesh.vertices, axis=1)
    assert np.abs(radii - RADIUS).max() < VOXEL
    assert abs(radii.mean() - RADIUS) < 0.05 * VOXEL
    assert np.abs(centroid(mesh)).max() < 0.02 * VOXEL, "pixel centres are where our cameras have them"
    assert signed_volume(mesh) == pytest.approx(4 / 3 * np.pi * RADIUS**3, rel=0.01)
    assert np.abs(mesh.colors - 255 * RED.numpy()).max() <= 1


def test_a_ball_of_surfels_becomes_a_sphere():
    mesh = fuse(depth_views(show(ball()), VIEWS), VOXEL)
    radii = np.linalg.norm(mesh.vertices, axis=1)
    # Discs that touch a sphere stand out from it, and at its rim each is wider than a pixel.
    assert 0 < radii.mean() - RADIUS < 0.4 * VOXEL
    assert np.abs(radii - RADIUS).max() < VOXEL
    assert signed_volume(mesh) == pytest.approx(4 / 3 * np.pi * RADIUS**3, rel=0.03)
    assert np.abs(mesh.colors.mean(0) - 255 * RED.numpy()).max() < 3


def test_plyfile_reads_the_file(tmp_path):
    mesh = Mesh(np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.int32), np.eye(3, dtype=np.uint8) * 200)
    written = vertices(write_mesh(tmp_path / "mesh.ply", mesh))
    assert written["x"].tolist() == [1, 0, 0]
    assert written["green"].tolist() == [0, 200, 0]


@pytest.mark.parametrize(
    ("shown", "views", "voxel", "named"),
    [
        (show(ball(opacity=-4.0)), VIEWS[:3], VOXEL, "half of the light"),
        *((show(ball()), VIEWS, voxel, f"voxel: .*{voxel}") for voxel in (0, float("inf"))),
        (show(ball()), VIEWS[:1], VOXEL, f"mesh: .* cells of {VOXEL:g}"),
        (show(ball()), VIEWS, 10.0, "mesh: .* cells of 10"),
        (sample("surfels").render, VIEWS, VOXEL, "show: "),
    ],
)
def test_what_makes_no_mesh(shown, views, voxel, named):
    refused(lambda: fuse(depth_views(shown, views), voxel), named)
