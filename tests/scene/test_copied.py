"""Scenes with all of their files in one folder."""

from dataclasses import replace

import pytest

from tests.fields.surfels.test_composition import ball
from tests.refusals import refused
from tests.scene.balls import ball_models
from texgs.fields.surfels.model_file import write_model
from texgs.scene.copied import write_copy
from texgs.scene.scene import Scene, SceneModel, SceneVolume
from texgs.scene.scene_file import read_scene
from texgs.volume.render import Appearance


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_parts_whose_names_would_be_one_file_get_two(tmp_path):
    models = ball_models(tmp_path, "TF01", "TF02")
    look = write_model(tmp_path / "look.safetensors", ball(7))
    models = {
        "TF01": replace(models["TF01"], texture=look),
        "TF01-texture": models["TF02"],
        "TF02": SceneModel(write_model(tmp_path / "other.safetensors", ball(8))),
    }
    copy = read_scene(write_copy(tmp_path / "kept", Scene(models)))
    contents = [
        copy.models[name].file.read_bytes() == model.file.read_bytes() for name, model in models.items()
    ]
    assert contents == [True] * 3
    assert copy.models["TF01"].texture.read_bytes() == look.read_bytes()
    assert names(tmp_path / "kept") == [
        "TF01-texture-2.safetensors",
        "TF01-texture.safetensors",
        "TF01.safetensors",
        "TF02.safetensors",
        "scene.yaml",
    ]


def test_what_an_earlier_scene_of_the_folder_needs_stays(tmp_path):
    models = ball_models(tmp_path, "TF01")
    first, second = (write_model(tmp_path / f"{n}.safetensors", ball(n)) for n in (5, 6))
    folder = tmp_path / "kept"
    before = read_scene(write_copy(folder, Scene({"TF01": replace(models["TF01"], texture=first)})))
    write_copy(folder, Scene({"TF01": replace(before.models["TF01"], texture=second)}))
    assert before.models["TF01"].texture.read_bytes() == first.read_bytes()
    after = read_scene(folder / "scene.yaml").models["TF01"]
    assert after.file == before.models["TF01"].file
    assert after.texture.read_bytes() == second.read_bytes()


def test_a_copy_that_fails_leaves_no_half_file(tmp_path, monkeypatch):
    scene = Scene(ball_models(tmp_path, "TF01"))

    def full(source, target):
        target.write(source.read(10))
        raise KeyboardInterrupt

    monkeypatch.setattr("texgs.core.io.copyfileobj", full)
    with pytest.raises(KeyboardInterrupt):
        write_copy(tmp_path / "kept", scene)
    assert names(tmp_path / "kept") == []


@pytest.mark.parametrize("place", ["scene.yaml", "scene.yaml/kept"])
def test_a_file_in_the_place_of_the_folder(tmp_path, place):
    (tmp_path / "scene.yaml").write_text("")
    refused(lambda: write_copy(tmp_path / place, Scene(ball_models(tmp_path, "TF01"))), "cannot be made")


@pytest.mark.parametrize("gone", ["TF01.safetensors", "volume.nrrd"])
def test_a_scene_of_which_a_file_is_gone_leaves_no_half_copy(tmp_path, gone):
    volume = SceneVolume(tmp_path / "volume.nrrd", {}, Appearance())
    volume.file.touch()
    scene = Scene(ball_models(tmp_path, "TF01"), volume=volume)
    (tmp_path / gone).unlink()
    refused(lambda: write_copy(tmp_path / "kept", scene), f"{gone}: no such file, which the scene needs")
    assert not (tmp_path / "kept").exists()


def test_a_result_of_the_workflow_is_no_place_for_a_copy(tmp_path):
    (tmp_path / "metrics.json").touch()
    refused(lambda: write_copy(tmp_path, Scene(ball_models(tmp_path, "TF01"))), "a result of the workflow")
    assert not (tmp_path / "scene.yaml").exists()
