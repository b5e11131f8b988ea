"""What a viewer is started with, and what pages are told of it."""

import math
from dataclasses import replace

import pytest
import torch

from tests.fields.surfels.test_composition import ball
from tests.fields.voxels.test_voxels import ball as voxels
from texgs.core.camera import orbit
from texgs.core.light import Light
from texgs.fields.surfels.model_file import write_model
from texgs.fields.voxels import write_voxels
from texgs.scene.scene import Scene, SceneModel
from texgs.scene.scene_file import read_scene
from texgs.scene.segment_file import write_segment
from texgs.scene.session import Session
from texgs.viewer.description import describe
from texgs.viewer.shared_edits import open_scene


def test_a_scene_and_a_model_are_saved_in_their_place(scene_file, tmp_path):
    opened = open_scene(scene_file)
    assert list(opened.scene.models) == ["TF01", "TF02"]
    assert (opened.folder, opened.name, opened.file) == (tmp_path, "scene.yaml", scene_file)
    assert open_scene(scene_file, tmp_path / "mine").folder == tmp_path / "mine"
    assert open_scene(tmp_path).scene == opened.scene, "a folder is the scene in it"
    opened = open_scene(write_model(tmp_path / "shell.safetensors", ball(1)))
    assert list(opened.scene.models) == ["shell"]
    assert (opened.folder, opened.name) == (tmp_path, "scene.yaml")


def test_a_job_keeps_its_scene_and_its_folder(scene_file, tmp_path, monkeypatch):
    """A job does not replace a folder that holds files of others."""
    (tmp_path / "metrics.json").write_text("{}")
    (project := tmp_path / "project").mkdir()
    monkeypatch.chdir(project)
    opened = open_scene(scene_file)
    assert (opened.folder, opened.name, opened.file) == (project, "edited.yaml", None)
    model = write_model(tmp_path / "model.safetensors", ball(1))
    assert open_scene(model).folder == project
    assert open_scene(model, tmp_path).folder == tmp_path


def described(tmp_path, *models, **values):
    files = [write_model(tmp_path / f"{i}.safetensors", model) for i, model in enumerate(models)]
    entries = {f"TF{i}": SceneModel(file) for i, file in enumerate(files)}
    session = Session(Scene(entries, **values))
    return session, describe("name", session.scene, session.composition)


def test_a_description_has_all_parts_and_what_they_can_show(tmp_path):
    model = ball(1)
    session, _ = described(tmp_path, model, ball(2, stage="shading"), light=Light("directional", 10.0, 20.0))
    half = write_segment(tmp_path / "half", model, torch.arange(len(model)) % 2 == 0)
    session.add_segment("TF0/half", half)
    session.set("TF0/half", "opacity", 0.5)
    told = describe("name", session.scene, session.composition)
    first, second = told["models"]
    assert [each["name"] for each in first["segments"]] == ["half"]
    assert first["segments"][0]["edit"]["opacity"] == 0.5
    assert first["fitted_palette"] == pytest.approx(model.parameters["palette"].tolist())
    assert not first["styled"]
    assert not first["segments"][0]["styled"]
    entry = replace(session.scene.models["TF0"], texture=tmp_path / "look.safetensors")
    looked = replace(session.scene, models={**session.scene.models, "TF0": entry})
    assert describe("name", looked, session.composition)["models"][0]["styled"], "its palette says so"
    numbers = ["opacity", "ambient", "diffuse", "specular", "shininess"]
    assert first["can"] == ["visible", "palette", *numbers, "tint", "look", "segments"]
    assert "palette" not in second["can"], "there is none without a texture"
    assert told["light"] == {"azimuth": 10, "polar": 20}
    assert told["modes"][0] == "shaded"
    assert "normal" in told["modes"]


def test_a_description_has_shadows_and_whether_the_scene_can_have_them(sphere_file, tmp_path):
    scene = read_scene(sphere_file)
    shadowed = replace(scene, light=Light("headlight", shadows=0.7, occlusion=0.5, reach=0.3))
    told = describe("name", shadowed, scene.open())
    assert told["light"] is None
    assert [told[key] for key in ("shadows", "occlusion", "reach")] == [0.7, 0.5, 0.3]
    assert told["can_shadow"]
    assert not describe("name", replace(scene, volume=None), scene.open())["can_shadow"]
    baked = Scene({"a": SceneModel(write_voxels(tmp_path / "a.safetensors", voxels()))}, volume=scene.volume)
    assert not describe("name", baked, baked.open())["can_shadow"], "light is in their colours"


def test_the_first_view_shows_the_whole_scene(tmp_path):
    model = ball(1, middle=2.0)
    _, told = described(tmp_path, model)
    view, means = told["views"][0], model.parameters["means"]
    assert told["bounds"]["center"] == pytest.approx([2, 2, 2], abs=0.1)
    whole = 0.5 + 2 * float(model.parameters["scales"].exp().max())  # with two standard deviations
    assert told["bounds"]["radius"] == pytest.approx(whole, abs=0.1)
    camera = orbit(view["azimuth"], view["polar"], view["distance"], told["fov_y"], 100, 100, view["target"])
    places, depth = camera.project(means)
    assert bool((depth > 0).all())
    inside = ((places > 0) & (places < 100)).all(dim=1).float().mean()
    assert inside > 0.98
    spread = (places.amax(dim=0) - places.amin(dim=0)).max()
    assert spread > 80 * 0.5 / whole, "it fills the picture"
    assert math.isclose(camera.position.sub(2).norm(), view["distance"], rel_tol=0.05)
