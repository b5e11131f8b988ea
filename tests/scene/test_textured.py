"""Textured meshes beside closed forms, and their files as VTK reads them."""

import json
import struct
from math import ceil, floor

import cv2
import numpy as np
import pytest
import pyvista
import torch
from hypothesis import given
from hypothesis import strategies as st

from tests.refusals import refused
from tests.scene.test_mesh import RADIUS, exact
from texgs.core.errors import DeviceError
from texgs.core.lens import Lens
from texgs.raster import Render
from texgs.scene.mesh import depth_views, fuse
from texgs.scene.textured import deviation, notes_on, textured, unwrap
from texgs.scene.textured_files import write_glb, write_obj
from texgs.volume.cameras import icosphere, spiral
from texgs.volume.space import Space

VOXEL, SIDE = 1 / 128, 1024
LENS = Lens(4.0311, 30, 256, 256)
MIRROR = Space("mirrored", "mm", [[-2, 0, 0, 5], [0, 2, 0, 6], [0, 0, 2, 7], [0, 0, 0, 1]])


def color_at(places):
    """A colour [.., 3] in [0, 1] that changes with the place."""
    return 0.5 + 0.4 * torch.sin(9 * places)


def painted(camera):
    """A sphere by ray casting, coloured by its places."""
    shown = exact(camera)
    return Render(
        color_at(camera.unproject(shown.median)) * shown.alpha[..., None], shown.alpha, median=shown.median
    )


@pytest.fixture(scope="module")
def ball():
    views = depth_views(painted, icosphere(2, LENS))
    return textured(fuse(views, VOXEL), views, 3 * VOXEL, 8000, SIDE)


def volume_of(vertices, triangles):
    """The volume inside triangles that are counter-clockwise from outside."""
    a, b, c = np.asarray(vertices, float)[triangles].transpose(1, 0, 2)
    return (np.cross(a, b) * c).sum() / 6


def sampled(model, at):
    """The places and the colours in the texture [F, 3] of barycentric coordinates [3] of each triangle."""
    places = np.einsum("k,fkc->fc", at, model.vertices[model.triangles])
    u, v = (np.einsum("k,fkc->fc", at, model.uv) * len(model.picture) - 0.5).T.astype(np.float32)
    colors = cv2.remap(model.picture, u[None], v[None], cv2.INTER_LINEAR)[0]
    return places, colors / 255


@pytest.mark.parametrize("at", [(1 / 3, 1 / 3, 1 / 3), (0.9, 0.05, 0.05), (0.02, 0.49, 0.49), (0, 0, 1)])
def test_the_texture_has_the_colors_of_the_places(ball, at):
    places, colors = sampled(ball, np.array(at))
    expected = color_at(torch.from_numpy(places)).numpy()
    assert np.abs(colors - expected).mean() < 0.01
    assert np.quantile(np.abs(colors - expected), 0.999) < 0.06  # neighbours would be off by up to 0.8


def test_the_mesh_is_the_closed_ball(ball):
    assert ball.open_edges == 0
    assert 7900 < len(ball.triangles) <= 8000
    assert np.abs(np.linalg.norm(ball.vertices, axis=1) - RADIUS).max() < VOXEL
    outwards = ball.vertices / np.linalg.norm(ball.vertices, axis=1, keepdims=True)
    assert (ball.normals * outwards).sum(1).min() > 0.9
    assert volume_of(ball.vertices, ball.triangles) == pytest.approx(4 / 3 * np.pi * RADIUS**3, rel=0.01)


def test_deviation_is_small_for_a_ball_and_counts_what_is_left_out(ball):
    level, lost = deviation(ball, painted, spiral(3, LENS))
    assert level > 27  # all of it at the silhouette
    assert lost < 0.01

    def with_more(camera):  # white is invisible over white, but not its opacity
        shown, whole = painted(camera), torch.ones(256, 256)
        return Render(shown.color + (1 - shown.alpha)[..., None], whole, median=shown.median)

    alphas = [painted(camera).alpha.mean() for camera in spiral(3, LENS)]
    assert deviation(ball, with_more, spiral(3, LENS))[1] == pytest.approx(1 - np.mean(alphas), abs=0.01)


def test_without_opengl_the_deviation_is_said_to_be_unknown(ball, monkeypatch):
    def fail():
        raise DeviceError("offscreen OpenGL: none")

    monkeypatch.setattr("texgs.volume.opengl.offscreen_opengl", fail)
    [note] = notes_on(ball, painted, spiral(3, LENS))
    assert "closed; how far it is from the scene is not known: offscreen OpenGL: none" in note


@given(st.lists(st.floats(0.001, 1.0), min_size=1, max_size=60), st.sampled_from([64, 128]))
def test_triangles_have_texels_of_their_own(sizes, side):
    """In a texture, corners lie among texels that belong to the triangle, with one more around them."""
    corner = np.array([[0, 0, 0], [1, 0, 0], [0.2, 0.8, 0]])
    vertices = (corner * np.array(sizes)[:, None, None]).reshape(-1, 3)
    triangles, uv, owner = unwrap(vertices, np.arange(len(vertices)).reshape(-1, 3), side)
    assert sorted(map(sorted, triangles.tolist())) == np.arange(len(vertices)).reshape(-1, 3).tolist()
    owner = owner.reshape(side, side)
    for face, places in enumerate(uv):
        for at in ((1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0.5, 0.5), (1 / 3, 1 / 3, 1 / 3)):
            u, v = np.array(at) @ places
            rows, columns = ({floor(x - 0.5), ceil(x - 0.5 - 1e-9)} for x in (v, u))
            assert (owner[np.ix_([*rows], [*columns])] == face).all(), "what bilinear lookups read"


def test_a_texture_that_is_too_small_is_refused():
    vertices = np.random.default_rng(0).random((3 * 600, 3))
    refused(
        lambda: unwrap(vertices, np.arange(1800).reshape(-1, 3), 64),
        "faces: expected 512 at most in a texture",
    )


def test_vtk_reads_the_glb_file(ball, tmp_path):
    path = write_glb(tmp_path / "ball.glb", ball, has_light=False, told={"unit": "mm"})
    read = pyvista.read(path)
    while isinstance(read, pyvista.MultiBlock):
        [read] = list(read)
    np.testing.assert_array_equal(read.points, ball.vertices[ball.triangles].reshape(-1, 3))
    np.testing.assert_array_equal(read.regular_faces.ravel(), np.arange(ball.triangles.size))
    np.testing.assert_allclose(read.active_texture_coordinates, ball.uv.reshape(-1, 2), atol=1e-7)
    description, data = parts_of(path)
    image = description["bufferViews"][description["images"][0]["bufferView"]]
    png = np.frombuffer(data, np.uint8)[image["byteOffset"] :][: image["byteLength"]]
    np.testing.assert_array_equal(cv2.imdecode(png, cv2.IMREAD_COLOR)[..., ::-1], ball.picture)
    assert description["asset"]["extras"] == {"unit": "mm"}
    assert "extensionsUsed" not in description
    baked = parts_of(write_glb(tmp_path / "lit.glb", ball, has_light=True))[0]
    assert baked["extensionsUsed"] == [*baked["materials"][0]["extensions"]] == ["KHR_materials_unlit"]


def parts_of(path):
    """The description and the data of a .glb file."""
    binary = path.read_bytes()
    assert struct.unpack("<4sII", binary[:12]) == (b"glTF", 2, len(binary))
    count = struct.unpack("<I", binary[12:16])[0]
    return json.loads(binary[20 : 20 + count]), binary[28 + count :]


def test_vtk_reads_the_obj_file(ball, tmp_path):
    path = write_obj(tmp_path / "ball.obj", ball)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["ball-texture.png", "ball.mtl", "ball.obj"]
    assert "map_Kd ball-texture.png" in (tmp_path / "ball.mtl").read_text()
    picture = cv2.imread(str(tmp_path / "ball-texture.png"))[..., ::-1]
    np.testing.assert_array_equal(picture, ball.picture)
    read = pyvista.read(path)
    corners = read.points[read.regular_faces]
    np.testing.assert_allclose(corners, ball.vertices[ball.triangles], atol=1e-6)
    flipped = read.active_texture_coordinates[read.regular_faces] * [1, -1] + [0, 1]
    np.testing.assert_allclose(flipped, ball.uv, atol=1e-6)


def test_placed_in_a_mirrored_space_the_outside_stays_outside(ball):
    placed = ball.placed(MIRROR)
    middle = np.array([5, 6, 7])
    np.testing.assert_allclose(placed.vertices, ball.vertices * [-2, 2, 2] + middle, atol=1e-5)
    volumes = [volume_of(each.vertices, each.triangles) for each in (ball, placed)]
    assert volumes[1] == pytest.approx(8 * volumes[0], rel=1e-3), "still counter-clockwise"
    assert (placed.normals * (placed.vertices - middle)).sum(1).min() > 0
    np.testing.assert_array_equal(placed.uv[:, ::-1], ball.uv)
