"""Measures of scenes that leave some of them undefined, and of fields that have another one's surfaces."""

from types import SimpleNamespace

import pytest
import torch

from tests.fields.surfels.test_composition import ball
from tests.models.clips import write_clip
from texgs.cli.stages.edit_metrics import agreement, clip_numbers
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.model_file import write_model
from texgs.metrics.clip import clip_scores
from texgs.models.clip import Clip
from texgs.scene.scene import Scene, SceneModel
from texgs.scene.scene_file import read_scene, write_scene
from texgs.volume.cameras import spiral as path

CAMERAS = path(12, 4.0, 30.0, 32, 32)
MISSING = {"vgg16": None, "lpips_vgg": None}


@pytest.fixture
def scenes(tmp_path):
    """Files of a ball's scene, as it is and as faint as a breath."""
    model = ball(1)
    faint = {**model.parameters, "opacities": torch.full_like(model.parameters["opacities"], -6.0)}
    files = {}
    for name, surfels in (("clear", model), ("faint", Surfels(faint, model.shading))):
        write_model(tmp_path / f"{name}.safetensors", surfels)
        scene = Scene({"ball": SceneModel(tmp_path / f"{name}.safetensors")})
        files[name] = tmp_path / f"{name}.yaml"
        write_scene(files[name], scene)
    return files


def measured(shown, geometry):
    scene = read_scene(shown)
    return agreement(scene.open(), scene, geometry, CAMERAS, 4, MISSING)


def test_a_scene_that_is_nowhere_opaque_has_no_consistency(scenes):
    assert 0 < measured(scenes["clear"], scenes["clear"])["short_rmse"] < 0.5
    assert measured(scenes["faint"], scenes["faint"]) == {}


def test_surfaces_are_those_of_the_geometry_that_is_given(scenes):
    """What hardly shows anything is nearly white everywhere, and consistent, on the surfaces of the ball."""
    clear, faint = (measured(scenes[name], scenes["clear"]) for name in ("clear", "faint"))
    assert 0 < faint["short_rmse"] < 0.2 * clear["short_rmse"]
    assert measured(scenes["clear"], scenes["faint"]) == {}


def test_clip_sees_the_edited_scene_and_the_one_before(scenes, tmp_path):
    (folder := tmp_path / "clip").mkdir()
    name = str(write_clip(folder))
    before, after = (read_scene(scenes[each]) for each in ("clear", "faint"))
    edit = SimpleNamespace(source_caption="a beetle", target_caption="a beetle made of gold")
    settings = SimpleNamespace(edit=edit, clip=name, weights={name: "here"})
    opened = after.open(), before.open()
    found = clip_numbers(settings, (after, before), opened, CAMERAS, "ball")
    views = [[scene.render(camera).color.clamp(0, 1) for camera in CAMERAS] for scene in opened]
    expected = clip_scores(Clip.load(name), *views, edit.source_caption, edit.target_caption)
    assert found["similarity"] == pytest.approx(expected.similarity, abs=1e-6)
    assert found["direction"] == pytest.approx(expected.direction, abs=1e-6)
    assert abs(found["direction"]) > 1e-4
