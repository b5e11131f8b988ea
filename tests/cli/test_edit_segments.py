"""Segments of a scene, edited from the command line."""

import pytest
import torch
import yaml

from tests.fields.surfels.test_composition import ball
from texgs.cli.main import main
from texgs.fields.surfels.model_file import write_model
from texgs.scene.scene import Scene, SceneModel
from texgs.scene.scene_file import read_scene, write_scene
from texgs.scene.segment_file import write_segment


@pytest.fixture
def scene(tmp_path):
    """A scene of a model whose name has a dot, and a file with a segment of it."""
    path = write_model(tmp_path / "model.safetensors", ball(1))
    write_segment(tmp_path / "half.safetensors", ball(1), torch.arange(150) % 2 == 0)
    return write_scene(tmp_path / "scene.yaml", Scene({"v1.2": SceneModel(path)}))


def edit(scene, *words, output="new.yaml"):
    return main(["edit", str(scene), *words, "--output", str(scene.with_name(output))])


def test_a_segment_is_added_edited_and_removed(scene):
    half = scene.with_name("half.safetensors")
    words = [f"v1.2/shell={half}", "v1.2/shell.opacity=0.5", "v1.2/shell.palette=#ff0000", "v1.2.diffuse=0.5"]
    assert edit(scene, *words) == 0
    model = read_scene(scene.with_name("new.yaml")).models["v1.2"]
    assert (model.edit.diffuse, model.edit.palette) == (0.5, None)
    assert (model.segments["shell"].edit.opacity, model.segments["shell"].edit.palette) == (0.5, (1, 0, 0))
    assert edit(scene.with_name("new.yaml"), "v1.2/shell.palette=", output="next.yaml") == 0
    segment = read_scene(scene.with_name("next.yaml")).models["v1.2"].segments["shell"]
    assert (segment.edit.opacity, segment.edit.palette) == (0.5, None)
    assert edit(scene.with_name("next.yaml"), "v1.2/shell=", "v1.2.diffuse=", output="back.yaml") == 0
    assert yaml.safe_load(scene.with_name("back.yaml").read_text()) == yaml.safe_load(scene.read_text())


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("v1.2/shell.opacity=1", "expected a segment of v1.2 (it has none), got shell"),
        ("v1.2/shell=", "expected a segment of v1.2 (it has none), got shell"),
        ("TF01/shell.opacity=1", "expected a model of the scene (v1.2), got TF01"),
        ("v1.2/shell=none.safetensors", "expected a file that is there, got none.safetensors"),
        ("v1.2/=scene.yaml", "expected a file that is there"),
    ],
)
def test_a_mistake_in_an_edit_of_a_segment_writes_nothing(scene, capsys, word, message):
    assert edit(scene, word) == 2
    assert f"{word}: {message}" in capsys.readouterr().err
    assert not scene.with_name("new.yaml").exists()
