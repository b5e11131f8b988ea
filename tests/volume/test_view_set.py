import json
from math import pi

import numpy as np
import pytest
import torch
from PIL import Image

from tests.real_data import real_data
from texgs.core.camera import Camera, intrinsics, orbit, orbit_direction
from texgs.core.errors import ArgumentError
from texgs.core.light import HEADLIGHT, Light
from texgs.core.ply_file import read_vertices
from texgs.volume.view_set import View, read_views, write_transforms

SIZE = (12, 8)  # pixels, width and height
LIGHTS = [HEADLIGHT, Light("directional", 30.0, -60.0), HEADLIGHT]
METADATA = {"volume": "sphere", "tf": {"name": "shell"}, "aabb": [[-0.5, -0.5, -0.5], [0.5, 0.5, 0.5]]}


def make_views(folder, split="train", count=3):
    views = []
    for index, light in enumerate(LIGHTS[:count]):
        path = folder / split / f"r_{index:04}.png"
        path.parent.mkdir(parents=True, exist_ok=True)
        pixels = np.random.default_rng(index).integers(0, 256, (SIZE[1], SIZE[0], 4), dtype=np.uint8)
        Image.fromarray(pixels).save(path)
        views.append(View(orbit(40 + 100 * index, 20 * index - 10, 2, 35, *SIZE), path, light))
    return views


@pytest.fixture
def folder(tmp_path):
    write_transforms(tmp_path, "train", make_views(tmp_path), METADATA)
    return tmp_path


def change(folder, edit):
    """Edit transforms_train.json as a user would."""
    path = folder / "transforms_train.json"
    values = json.loads(path.read_text())
    edit(values)
    path.write_text(json.dumps(values))


def test_what_is_written_is_read(folder):
    write_transforms(folder, "test", make_views(folder, "test", count=1), {})
    views, written = read_views(folder), make_views(folder)
    assert (views.folder, views.metadata) == (folder, METADATA)
    assert [len(views.train), len(views.test)] == [3, 1]
    for ours, theirs in zip(views.train, written, strict=True):
        assert (ours.path, ours.light) == (theirs.path, theirs.light)
        assert (ours.camera.width, ours.camera.height) == SIZE
        torch.testing.assert_close(ours.camera.viewmat, theirs.camera.viewmat, rtol=0, atol=2e-7)
        assert torch.equal(ours.camera.K, theirs.camera.K)
    assert views.test[0].path == folder / "test" / "r_0000.png"
    assert views.relit == []
    write_transforms(folder, "relit", make_views(folder, "relit", count=2), {})
    assert [(view.path.name, view.light) for view in read_views(folder).relit] == [
        ("r_0000.png", LIGHTS[0]),
        ("r_0001.png", LIGHTS[1]),
    ]


def test_an_off_centre_lens_with_oblong_pixels_survives(tmp_path):
    (view, *_) = make_views(tmp_path, count=1)
    K = torch.tensor([[31.0, 0.0, 5.25], [0.0, 27.0, 4.5], [0.0, 0.0, 1.0]])
    other = View(Camera(view.camera.viewmat, K, *SIZE), view.path, view.light)
    write_transforms(tmp_path, "train", [other], {})
    assert torch.equal(read_views(tmp_path).train[0].camera.K, K)


def test_the_file_is_what_other_readers_expect(folder):
    values = json.loads((folder / "transforms_train.json").read_text())
    frame, camera = values["frames"][1], make_views(folder)[1].camera
    assert frame["file_path"] == "./train/r_0001"
    assert frame["light"] == {"kind": "directional", "azimuth": 30.0, "polar": -60.0}
    assert values["frames"][0]["light"] == {"kind": "headlight"}
    matrix = np.array(frame["transform_matrix"])
    np.testing.assert_allclose(matrix[:3, 3], camera.position, atol=1e-6)
    np.testing.assert_allclose(matrix[:3, 2], camera.position / 2, atol=1e-6)  # z points away from the origin
    assert matrix[1, 0] == pytest.approx(0, abs=1e-7)  # x is horizontal
    assert matrix[1, 1] > 0  # y is up
    # Half the width is seen under half the horizontal angle.
    focal = 0.5 * SIZE[0] / np.tan(values["camera_angle_x"] / 2)
    assert focal == pytest.approx(values["fl_x"]) == pytest.approx(float(intrinsics(35, *SIZE)[0, 0]))


@pytest.mark.parametrize(("name", "size"), [("TF01", 800), ("TF04_400", 400)])
def test_the_published_views_load_unchanged(name, size):
    views = read_views(real_data(f"vortex/{name}"))
    assert (len(views.train), len(views.test), views.metadata) == (92, 181, {})
    for view in views.train + views.test:
        camera = view.camera
        assert (camera.width, camera.height, view.light.kind) == (size, size, "headlight")
        torch.testing.assert_close(camera.K, intrinsics(30, size, size))
        torch.testing.assert_close(camera.viewmat[:3, 3], torch.tensor([0, 0, 4.0311]), atol=1e-4, rtol=0)
        assert camera.viewmat[1, 1] < 0  # the image's y axis points down


def test_published_pixels_are_seen_where_the_cameras_look():
    # The object's points, projected, lie where the image is covered: axes and signs are right.
    folder = real_data("vortex/TF04_400")
    table = read_vertices(folder / "points3d.ply")
    points = torch.from_numpy(np.stack([table[axis] for axis in "xyz"], axis=1).astype(np.float32))
    for view in read_views(folder).train[::13]:
        u, v = view.camera.project(points)[0].floor().long().T
        assert (view.load()[..., 3][v, u] > 0).float().mean() > 0.9


def test_pixels_are_as_stored_and_opaque_without_alpha(folder):
    view = read_views(folder).train[1]
    np.testing.assert_array_equal(view.load(), np.asarray(Image.open(view.path)))
    Image.new("RGB", SIZE, (10, 20, 30)).save(view.path)
    assert view.load().unique(dim=0).unique(dim=1).flatten().tolist() == [10, 20, 30, 255]
    view.path.unlink()
    with pytest.raises(ArgumentError, match=r"r_0001.png: no such file"):
        view.load()


def test_directions_of_lights():
    expected = orbit_direction(30, 40)
    torch.testing.assert_close(HEADLIGHT.direction(orbit(30, 40, 3, 30, 8, 8)), expected, atol=1e-6, rtol=0)
    front = Light("directional", -90, 0).direction(orbit(30, 40, 3, 30, 8, 8))
    torch.testing.assert_close(front, torch.tensor([0.0, 0, 1]).double())


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (lambda d: d.pop("frames"), "transforms_train.json: expected an object with a list of frames"),
        (lambda d: d["frames"][1].pop("file_path"), "frame 1: file_path: expected the path of an image"),
        (lambda d: d["frames"][2].pop("transform_matrix"), r"frame 2 \(r_0002\): transform_matrix: expected"),
        (lambda d: d["frames"][2].update(transform_matrix=[[1, 2], [3]]), "four rows of four numbers"),
        (lambda d: d["frames"][0].update(transform_matrix=[[0.0] * 4] * 4), r"frame 0 .*singular, scaled"),
        (lambda d: d["frames"][0].update(transform_matrix=np.diag([1, 1, -1, 1]).tolist()), "mirrored"),
        (lambda d: d["frames"][0]["transform_matrix"][0].__setitem__(3, float("nan")), "not finite"),
        (lambda d: d["frames"][1]["light"].update(polar=400), r"frame 1 .*: light: .* degrees, got 400"),
        (lambda d: d["frames"][1]["light"].pop("polar"), r"frame 1 .*expected the key polar, found kind"),
        (lambda d: d.update(w=13), "expected 13 x 8 pixels as w and h say, got 12 x 8"),
        (lambda d: d.pop("w"), "expected the key w, found camera_angle_x, h"),
        (lambda d: d.update(fl_x=0), "expected focal lengths above 0, got 0"),
        (lambda d: (d.pop("fl_x"), d.update(camera_angle_x=pi)), "expected radians between 0 and pi"),
    ],
)
def test_mistakes_in_the_file_are_named(folder, edit, message):
    change(folder, edit)
    with pytest.raises(ArgumentError, match=message):
        read_views(folder)


def test_mistakes_in_the_folder_are_named(folder):
    def refused(message):
        with pytest.raises(ArgumentError, match=message):
            read_views(folder)

    with pytest.raises(ArgumentError, match=r"nowhere: expected a folder of views, .*transforms_train.json"):
        read_views(folder / "nowhere")
    change(folder, lambda values: [values.pop(key) for key in ("w", "h")])
    images = [folder / "train" / f"r_000{index}.png" for index in range(3)]
    Image.new("RGBA", (5, 5)).save(images[2])
    refused(r"r_0002.png: expected 12 x 8 pixels as r_0000.png has, got 5 x 5")
    images[1].write_bytes(b"no image")
    refused(r"r_0001.png: expected an image")
    images[1].unlink()
    images[2].unlink()
    refused(r"r_0001.png: no such image; 2 of 3")
