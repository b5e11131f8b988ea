"""Training views and transfer functions beside the models of a scene."""

import json
import logging
from dataclasses import replace

import numpy as np
import pytest
import torch

from tests.fields.surfels.test_composition import ball
from tests.viewer.training_views import SIZE, TF, write_results
from texgs.core.camera import orbit
from texgs.fields.surfels.model_file import write_model
from texgs.scene.scene import Scene, SceneModel
from texgs.viewer.origins import Origins, fitted, orbit_of


@pytest.fixture
def scene(tmp_path):
    return write_results(tmp_path)


def test_a_page_can_go_to_the_training_views_with_y_up(scene):
    places = Origins(scene).places
    assert [each["name"] for each in places] == ["view 0", "view 1", "view 2"]
    assert (places[1]["azimuth"], places[1]["polar"]) == pytest.approx((90, 20), abs=1e-3)
    assert (places[1]["distance"], places[1]["fov_y"]) == pytest.approx((3, 40), abs=1e-3)
    aside = orbit_of(orbit(30, 20, 3.0, 40.0, SIZE, SIZE, target=(0.3, 0, 0)), (0.3, 0, 0))
    assert aside["target"] == pytest.approx([0.3, 0, 0], abs=1e-5)
    assert (aside["azimuth"], aside["polar"], aside["distance"]) == pytest.approx((30, 20, 3), abs=1e-3)
    camera = orbit(30, 20, 3.0, 40.0, SIZE, SIZE)
    assert orbit_of(camera, tuple(2 * camera.position.tolist()[i] for i in range(3))) is None, "it is behind"
    rolled = camera.viewmat.clone()
    rolled[:2] = torch.stack([-rolled[1], rolled[0]])
    assert orbit_of(replace(camera, viewmat=rolled), (0, 0, 0)) is None


def test_transfer_functions_come_with_their_histogram(scene):
    transfer = Origins(scene).transfer
    assert transfer["functions"] == [{"model": "TF01", "opacity": TF["opacity"], "color": [0.5, 0.0, 0.5]}]
    assert (transfer["minimum"], transfer["maximum"]) == (0, 4)
    assert transfer["histogram"] == [10] * 256


@pytest.mark.parametrize("text", ["{", "[]", '{"minimum": 0, "maximum": 1, "histogram": []}'])
def test_a_damaged_summary_of_the_volume_is_left_out(scene, tmp_path, text):
    (tmp_path / "volume/volume.json").write_text(text)
    assert Origins(scene).transfer is None


def test_a_scene_by_itself_has_nothing(tmp_path):
    file = write_model(tmp_path / "a/b/c/d/e/f/model.safetensors", ball(1))
    result = Origins(Scene({"TF01": SceneModel(file)}))
    assert (result.has_views, result.places, result.transfer) == (False, [], None)


@pytest.mark.parametrize("text", ["{", "[]", '{"frames": []}'])
def test_what_is_damaged_is_left_out_and_said(scene, tmp_path, caplog, text):
    (tmp_path / "TF01/views/transforms_train.json").write_text(text)
    with caplog.at_level(logging.WARNING, "texgs.viewer"):
        assert Origins(scene).has_views is False
    assert "transforms_train.json" in caplog.text


@pytest.mark.parametrize("tf", [None, {}, {"opacity": [[1]], "color": []}, {**TF, "color": [["a", 1, 1, 1]]}])
def test_views_without_a_transfer_function_are_still_views(scene, tmp_path, tf):
    path = tmp_path / "TF01/views/transforms_train.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), "tf": tf}))
    result = Origins(scene)
    assert result.has_views
    assert result.transfer is None


def test_a_picture_fits_into_a_frame():
    pixels = np.zeros((10, 20, 3), np.uint8)
    pixels[2:8, 4:16] = 200
    framed = fitted(pixels, 40, 40)
    assert framed.shape == (40, 40, 3)
    assert (framed[:10] == 0).all()
    assert framed[20, 20].tolist() == [200, 200, 200]
