"""Training views and transfer functions beside the models of a scene."""

import json
import logging
from dataclasses import replace

import numpy as np
import pytest
import torch

from tests.fields.surfels.test_composition import ball
from texgs.core.camera import orbit
from texgs.core.errors import ArgumentError
from texgs.core.image import write_png
from texgs.core.io import write_json
from texgs.core.light import Light
from texgs.fields.part_edit import PartEdit
from texgs.fields.surfels.model_file import write_model
from texgs.scene.scene import Scene, SceneModel
from texgs.scene.session import Session
from texgs.viewer.messages import Orbit, View
from texgs.viewer.origins import GAIN, Origins, fitted, orbit_of
from texgs.volume.view_set import View as Image
from texgs.volume.view_set import write_transforms

LIGHT = Light("directional", 10, 40)
PLACES = [(0, 0), (90, 20), (-120, -40)]  # azimuth and polar angle
SIZE = 48
COLOR = [[1.0, 1.0, 0.0, 0.0], [3.0, 0.0, 0.0, 1.0]]
TF = {"name": "TF01", "opacity": [[1.0, 0.0], [3.0, 0.5]], "color": COLOR}


def camera_at(azimuth, polar):
    return orbit(azimuth, polar, 3.0, 40.0, SIZE, SIZE)


@pytest.fixture
def scene(tmp_path):
    """Two models in a folder of results; the first has views, which it renders itself."""
    models = {}
    for seed, name in enumerate(("TF01", "TF02"), 1):
        file = tmp_path / name / "quick/texture/model.safetensors"
        models[name] = SceneModel(write_model(file, ball(seed)))
    alone = Session(Scene({"TF01": models["TF01"]}))
    folder, views = tmp_path / "TF01/views", []
    for index, place in enumerate(PLACES):
        camera = camera_at(*place)
        shown = torch.from_numpy(alone.frame(camera, scene=replace(alone.scene, light=LIGHT))) / 255
        path = write_png(folder / f"train/r_{index}.png", shown)
        views.append(Image(camera, path, LIGHT))
    write_transforms(folder, "train", views, {"tf": TF})
    write_json(tmp_path / "volume/volume.json", {"minimum": 0, "maximum": 4, "histogram": [5] * 512})
    return Scene(models)


def only(scene, name):
    models = {key: replace(x, edit=PartEdit(visible=key == name)) for key, x in scene.models.items()}
    return replace(scene, models=models)


def view(mode, azimuth=80.0, polar=10.0, width=SIZE):
    return View(Orbit((0.0, 0.0, 0.0), azimuth, polar, 5.0, 40.0, width, SIZE), mode=mode)


def origins(scene):
    return Origins(scene, Session(scene))


def test_the_view_that_is_nearest_is_shown(scene):
    shown = only(scene, "TF01")
    truth = origins(scene).frame(view("truth"), shown, 1.0)
    rendered = Session(shown).frame(camera_at(*PLACES[1]), scene=replace(shown, light=LIGHT))
    assert (truth == rendered).all()
    wide = origins(scene).frame(view("truth", width=2 * SIZE), shown, 1.0)
    assert (wide[:, SIZE // 2 : -SIZE // 2] == truth).all(), "the view is in the middle of a wide frame"
    assert (wide[:, : SIZE // 2] == truth[0, 0]).all()


def test_the_difference_is_that_of_the_scene_under_the_light_of_the_view(scene):
    result, shown = origins(scene), only(scene, "TF01")
    assert result.frame(view("difference"), shown, 1.0).max() <= GAIN
    entry = shown.models["TF01"]
    half = replace(shown, models={**shown.models, "TF01": replace(entry, edit=PartEdit(opacity=0.5))})
    assert result.frame(view("difference"), half, 1.0).max() > 10 * GAIN


def test_views_show_one_transfer_function(scene):
    for shown in (scene, only(scene, "TF02"), only(scene, "none")):
        with pytest.raises(ArgumentError, match="Training views show one transfer function each"):
            origins(scene).frame(view("truth"), shown, 1.0)


def test_a_page_can_go_to_the_training_views_that_are_on_an_orbit(scene):
    places = origins(scene).places
    assert [each["name"] for each in places] == ["view 0", "view 1", "view 2"]
    assert (places[1]["azimuth"], places[1]["polar"]) == pytest.approx((90, 20), abs=1e-3)
    assert (places[1]["distance"], places[1]["fov_y"]) == pytest.approx((3, 40), abs=1e-3)
    assert orbit_of(orbit(30, 20, 3.0, 40.0, SIZE, SIZE, target=(0.3, 0, 0))) is None


def test_transfer_functions_come_with_their_histogram(scene):
    transfer = origins(scene).transfer
    assert transfer["functions"] == [{"model": "TF01", "opacity": TF["opacity"], "color": [0.5, 0.0, 0.5]}]
    assert (transfer["minimum"], transfer["maximum"]) == (0, 4)
    assert transfer["histogram"] == [10] * 256


@pytest.mark.parametrize("text", ["{", "[]", '{"minimum": 0, "maximum": 1, "histogram": []}'])
def test_a_damaged_summary_of_the_volume_is_left_out(scene, tmp_path, text):
    (tmp_path / "volume/volume.json").write_text(text)
    assert origins(scene).transfer is None


def test_a_scene_by_itself_has_nothing(tmp_path):
    file = write_model(tmp_path / "a/b/c/d/e/f/model.safetensors", ball(1))
    result = origins(Scene({"TF01": SceneModel(file)}))
    assert (result.modes, result.places, result.transfer) == ([], [], None)


@pytest.mark.parametrize("text", ["{", "[]", '{"frames": []}'])
def test_what_is_damaged_is_left_out_and_said(scene, tmp_path, caplog, text):
    (tmp_path / "TF01/views/transforms_train.json").write_text(text)
    with caplog.at_level(logging.WARNING, "texgs.viewer"):
        assert origins(scene).modes == []
    assert "transforms_train.json" in caplog.text


@pytest.mark.parametrize("tf", [None, {}, {"opacity": [[1]], "color": []}, {**TF, "color": [["a", 1, 1, 1]]}])
def test_views_without_a_transfer_function_are_still_views(scene, tmp_path, tf):
    path = tmp_path / "TF01/views/transforms_train.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), "tf": tf}))
    result = origins(scene)
    assert result.modes == ["truth", "difference"]
    assert result.transfer is None


def test_a_picture_fits_into_a_frame():
    pixels = np.zeros((10, 20, 3), np.uint8)
    pixels[2:8, 4:16] = 200
    framed = fitted(pixels, 40, 40)
    assert framed.shape == (40, 40, 3)
    assert (framed[:10] == 0).all()
    assert framed[20, 20].tolist() == [200, 200, 200]
