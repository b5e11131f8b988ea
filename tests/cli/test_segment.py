"""`texgs segment`: clicks become a segment of the scene, which is edited and taken back."""

from dataclasses import replace

import numpy as np
import pytest
import torch
import yaml
from PIL import Image

from tests.edit.lift_scenes import two_balls, write_two_balls
from tests.edit.test_lift import pixel_of
from texgs.cli.main import main
from texgs.core.camera import orbit
from texgs.fields.surfels.model_file import write_model
from texgs.fields.surfels.variants import write_texture
from texgs.fitting.texels import add_texture
from texgs.scene.scene import Scene, SceneModel
from texgs.scene.scene_file import read_scene, write_scene
from texgs.scene.segment_file import read_segment, write_segment

SIZE = 120
LENS = ("--radius", "4", "--fov", "22", "--width", str(SIZE))
FAST = ("--masks", "grabcut", "--views", "12", "--size", "96")


@pytest.fixture
def scene(tmp_path):
    return write_two_balls(tmp_path)


def pixel(place):
    """What --point takes for a place, seen from the front."""
    return ",".join(str(int(x)) for x in pixel_of(place, orbit(-90, 0, 4.0, 22.0, SIZE, SIZE)))


LEFT, RIGHT = pixel((-0.3, 0.0, 0.25)), pixel((0.3, 0.1, 0.35))


def segment(scene, *words, name="red", output="new.yaml"):
    where = ["--name", name, "--output", str(scene.with_name(output))]
    return main(["segment", str(scene), "--view", "-90,0", *LENS, *FAST, *where, *words])


def colors(scene, output):
    """How red and how blue a picture is."""
    words = ["--azimuth", "-90", "--polar", "0", *LENS, "--output", str(output)]
    assert main(["render", str(scene), *words]) == 0
    picture = np.asarray(Image.open(output)).astype(int)
    hue = picture[..., 0] - picture[..., 2]
    return int((hue > 60).sum()), int((hue < -60).sum()), picture


def test_a_segment_is_made_edited_and_taken_back(scene, tmp_path, capsys):
    red, blue, before = colors(scene, tmp_path / "0.png")
    assert segment(scene, "--point", LEFT, "--not", RIGHT) == 0
    printed = capsys.readouterr()
    assert f"{tmp_path / 'new.yaml'}\n{tmp_path / 'new-balls-red.safetensors'}" in printed.out
    assert "balls/red: masks of " in printed.err
    assert " of 13 views\n" in printed.err
    assert " of 3000 surfels" in printed.err
    new = tmp_path / "new.yaml"
    assert np.array_equal(colors(new, tmp_path / "1.png")[2], before), "nothing is edited yet"
    edited = tmp_path / "edited.yaml"
    assert main(["edit", str(new), "balls/red.visible=false", "--output", str(edited)]) == 0
    red_left, blue_left, _ = colors(edited, tmp_path / "2.png")
    assert red_left < 0.05 * red
    assert blue_left > 0.95 * blue
    back = tmp_path / "back.yaml"
    assert main(["edit", str(edited), "balls/red=", "--output", str(back)]) == 0
    assert yaml.safe_load(back.read_text()) == yaml.safe_load(scene.read_text())


def test_a_box_selects_what_is_in_it(scene, tmp_path):
    box = [*pixel((-0.62, 0.35, 0.0)).split(","), *pixel((-0.02, -0.35, 0.0)).split(",")]
    assert segment(scene, "--box", *box) == 0
    model, number = two_balls()
    mask = read_segment(tmp_path / "new-balls-red.safetensors", model)
    assert (mask == (number == 0)).float().mean() > 0.97


def test_a_second_segment_gets_what_the_first_left(scene, tmp_path, capsys):
    assert segment(scene, "--point", LEFT, "--not", RIGHT) == 0
    again = (tmp_path / "new.yaml", "--point", LEFT, "--not", RIGHT)
    assert segment(*again, name="both", output="next.yaml") == 2
    assert "expected surfels that no segment of balls has, got none; remove one that has them (red)" in (
        capsys.readouterr().err
    )
    assert segment(tmp_path / "new.yaml", "--point", RIGHT, name="blue", output="next.yaml") == 0
    model = read_scene(tmp_path / "next.yaml").models["balls"]
    assert list(model.segments) == ["red", "blue"]


def test_what_is_clicked_on_has_the_textures_of_the_scene(tmp_path):
    fitted = two_balls()[0]
    sizes = torch.full((len(fitted), 2), 2, dtype=torch.int32)
    model = add_texture(fitted, torch.tensor([0.5, 0.2, 0.5]), sizes)
    swapped = replace(model, parameters={**model.parameters, "colors": model.parameters["colors"].flip(1)})
    texture = write_texture(tmp_path / "swapped.safetensors", swapped)  # red is blue, and blue is red
    entry = SceneModel(write_model(tmp_path / "model.safetensors", model), texture=texture)
    scene, picture = write_scene(tmp_path / "scene.yaml", Scene({"balls": entry})), tmp_path / "preview.png"
    assert segment(scene, "--point", LEFT, "--not", RIGHT, "--preview", str(picture)) == 0
    shown = np.asarray(Image.open(picture)).astype(int)
    rendered = colors(scene, tmp_path / "rendered.png")[2]
    right = np.s_[:, SIZE - 30 :]  # part of the right ball, beside the mask and the clicks
    assert np.abs(shown[right] - rendered[right]).max() <= 1, "a step of 8 bits"
    assert not (tmp_path / "new.yaml").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "--point: expected one at least, or --box, got none"),
        (["--box", "nan", "9", "20", "20"], "outline: expected corners in 120 x 120 pixels, got (nan, 9)"),
        (["--point", LEFT, "--model", "TF01"], "--model: expected one of balls, got TF01"),
        (["--point", LEFT, "--masks", "none"], "masks: expected mobile_sam, sam_vit_h, grabcut or a folder"),
        (["--point", LEFT, "--output", "."], "--output: expected a file that ends in .yaml, got ."),
        (["--point", LEFT, "--preview", "a.jpg"], "--preview: expected a file"),
        (["--point", LEFT, "--view", "inf,0"], "azimuth: expected degrees, got inf"),
        (["--point", LEFT, "--name", "half"], "balls/half: is there already; choose another name"),
    ],
)
def test_a_mistake_writes_nothing(scene, tmp_path, capsys, words, message):
    mask = write_segment(tmp_path / "half", two_balls()[0], torch.arange(3000) < 9)
    assert main(["edit", str(scene), f"balls/half={mask}", "--output", str(scene)]) == 0
    assert segment(scene, *words) == 2
    assert message in capsys.readouterr().err
    assert sorted(x.name for x in tmp_path.iterdir()) == ["balls.safetensors", "half", "scene.yaml"]


def test_a_model_whose_name_has_a_slash(scene, tmp_path):
    model = read_scene(scene).models["balls"]
    other = write_scene(tmp_path / "other.yaml", Scene({"run/balls": model}))
    assert segment(other, "--point", LEFT, "--not", RIGHT) == 0
    assert list(read_scene(tmp_path / "new.yaml").models["run/balls"].segments) == ["red"]
    assert (tmp_path / "new-run-balls-red.safetensors").is_file()
