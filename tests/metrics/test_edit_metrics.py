"""Measures of scenes that leave some of them undefined, and of fields that have another one's surfaces."""

import sys
from dataclasses import replace

import pytest
import torch

from tests.fields.surfels.test_composition import ball
from tests.models.clips import write_clip
from texgs.core.cache import Checksums
from texgs.core.lens import Lens
from texgs.fields.part_edit import PartEdit
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.model_file import write_model
from texgs.metrics.edits import clip, consistency
from texgs.metrics.metric import MeasuredScene, values_of
from texgs.models.clip import Clip, clip_scores
from texgs.models.weights import checksum
from texgs.scene.scene import Scene, SceneModel
from texgs.scene.scene_file import read_scene, write_scene
from texgs.volume.cameras import spiral as path

CAMERAS = path(12, Lens(4.0, 30.0, 32, 32))
CLIP = "clip-vit-base-patch32"
MISSING = {"vgg16": None, "lpips_vgg": None, CLIP: None}


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


def subject(before, after, geometry, **more):
    """What metrics look at, of scene files."""
    scenes = read_scene(before), read_scene(after)
    some = {"cameras": CAMERAS, "compared": 4, "captions": ("", ""), "clip": CLIP}
    some |= {"weights": MISSING, "styles": [], **more}
    return MeasuredScene("ball", scenes, tuple(scene.open() for scene in scenes), geometry, **some)


def measured(shown, geometry):
    given = subject(geometry, shown, geometry, compared=len(CAMERAS))
    return values_of(given, [consistency.METRIC])


def test_a_scene_that_is_nowhere_opaque_has_no_consistency(scenes):
    assert 0 < measured(scenes["clear"], scenes["clear"])["short_rmse"] < 0.5
    assert measured(scenes["faint"], scenes["faint"]) == {}


def test_surfaces_are_those_of_the_geometry_that_is_given(scenes):
    """What hardly shows anything is nearly white everywhere, and consistent, on the surfaces of the ball."""
    clear, faint = (measured(scenes[name], scenes["clear"]) for name in ("clear", "faint"))
    assert 0 < faint["short_rmse"] < 0.2 * clear["short_rmse"]
    assert measured(scenes["clear"], scenes["faint"]) == {}


def test_surfaces_of_hidden_models_do_not_count(scenes, tmp_path):
    """Opaque surfels in front of a part of the ball."""
    alone = read_scene(scenes["clear"])
    write_model(tmp_path / "other.safetensors", ball(2, middle=0.3))
    both = {**alone.models, "other": SceneModel(tmp_path / "other.safetensors")}
    write_scene(tmp_path / "both.yaml", Scene(both))
    hidden = {**both, "other": replace(both["other"], edit=PartEdit(visible=False))}
    write_scene(tmp_path / "hidden.yaml", Scene(hidden))
    shown = {"hidden": tmp_path / "hidden.yaml", "alone": scenes["clear"]}
    expected = measured(scenes["clear"], scenes["clear"])["short_rmse"]
    of_both = {name: measured(file, tmp_path / "both.yaml")["short_rmse"] for name, file in shown.items()}
    assert of_both["hidden"] == pytest.approx(expected, rel=1e-4)
    assert of_both["alone"] != pytest.approx(expected, rel=0.05)


def test_clip_without_weights_or_without_transformers_is_not_measured_and_says_why(
    scenes, tmp_path, monkeypatch
):
    monkeypatch.setenv("TEXGS_WEIGHTS", str(tmp_path))
    monkeypatch.setenv("HF_HUB_CACHE", str(tmp_path))
    given = subject(*[scenes["clear"]] * 3, captions=("a beetle", "gold"))
    assert clip.run(given)["clip_missing"].startswith(f"the weights of {CLIP} are not on this machine;")
    (tmp_path / CLIP).mkdir()
    for name in ("config.json", "model.safetensors", "vocab.json"):
        (tmp_path / CLIP / name).write_text("{}")
    monkeypatch.setitem(sys.modules, "transformers", None)
    planned = {CLIP: checksum(CLIP, Checksums())}
    assert clip.run(replace(given, weights=planned)) == {
        "clip_missing": f"transformers, which reads {CLIP}, is not installed; pip install '.[models]' adds it"
    }


def test_clip_sees_the_edited_scene_and_the_one_before(scenes, tmp_path):
    (folder := tmp_path / "clip").mkdir()
    name = str(write_clip(folder))
    captions = "a beetle", "a beetle made of gold"
    files = scenes["clear"], scenes["faint"], scenes["clear"]
    given = subject(*files, captions=captions, clip=name, weights={name: "here"})
    scores = clip.run(given)
    cameras = [CAMERAS[place] for place in (1, 4, 7, 10)]
    views = [[scene.render(camera).color.clamp(0, 1) for camera in cameras] for scene in given.compositions]
    similarity, direction = clip_scores(Clip.load(name), *reversed(views), *captions)
    assert scores["similarity"] == pytest.approx(similarity, abs=1e-6)
    assert scores["direction"] == pytest.approx(direction, abs=1e-6)
    assert abs(scores["direction"]) > 1e-4
