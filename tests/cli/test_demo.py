import torch
from PIL import Image

from texgs.cli.demo_scene import TEXELS, knot_scene
from texgs.cli.main import main
from texgs.core.rotation import quats_to_matrices


def test_scene_is_a_closed_tube():
    scene = knot_scene()
    n = len(scene.means)
    assert len(scene.texels) == n * TEXELS**2
    assert scene.texels.min() >= 0
    assert scene.texels.max() <= 1
    first, last = scene.means[:24], scene.means[-24:]
    gap = torch.cdist(first, last).min(dim=1).values
    assert gap.max() < 2 * scene.scales.max(), "the ends of the knot do not meet"
    torch.testing.assert_close(scene.texels, knot_scene().texels, atol=0, rtol=0)


def test_normals_point_out_of_the_tube():
    scene = knot_scene(n_along=60, n_around=20)
    rings = scene.means.reshape(60, 20, 3)
    normals = quats_to_matrices(scene.quats)[..., 2].reshape(60, 20, 3)
    assert ((rings - rings.mean(dim=1, keepdim=True)) * normals).sum(-1).min() > 0


def test_demo_writes_its_files(tmp_path, capsys):
    assert main(["demo", "--output", str(tmp_path), "--frames", "3", "--size", "64"]) == 0
    assert str(tmp_path) in capsys.readouterr().out
    names = ["sheet.png", "turntable.png", "view_000.png", "view_001.png", "view_002.png"]
    assert sorted(path.name for path in tmp_path.iterdir()) == names
    with Image.open(tmp_path / "view_000.png") as picture:
        assert picture.size == (64, 64)
        assert len(picture.getcolors(maxcolors=64 * 64)) > 500, "an empty picture"
    with Image.open(tmp_path / "turntable.png") as animation:
        assert animation.n_frames == 3


def test_mistakes_are_one_sentence(tmp_path, capsys):
    assert main(["demo", "--output", str(tmp_path), "--frames", "0"]) == 2
    assert "expected at least 1, got 0" in capsys.readouterr().err
