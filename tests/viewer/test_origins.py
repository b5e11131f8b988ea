"""Training views and transfer functions beside the models of a scene."""

import logging
from dataclasses import replace

import numpy as np
import pytest
import torch

from tests.fields.surfels.test_composition import ball
from tests.viewer.training_views import SIZE, TF, write_results
from texgs.core.camera import orbit
from texgs.fields.surfels.model_file import write_model
from texgs.scene.scene import Scene, SceneModel, SceneVolume
from texgs.viewer.origins import Origins, fitted, orbit_of
from texgs.volume.transfer import TransferFunction


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


def test_transfer_functions_come_with_the_histogram_of_their_volume(scene, tmp_path):
    assert Origins(scene).transfer is None, "it names no volume"
    transfer = Origins(named(scene, tmp_path)).transfer
    assert (transfer["minimum"], transfer["maximum"]) == (0, 4)
    assert transfer["histogram"] == [10] * 256


def named(scene, folder):
    """The scene with its volume."""
    tfs = {"TF01": TransferFunction(TF["opacity"], TF["color"])}
    return replace(scene, volume=SceneVolume(folder / "volume/volume.nrrd", tfs))


@pytest.mark.parametrize("text", ["{", "[]", '{"minimum": 0, "maximum": 1, "histogram": []}', ""])
def test_without_a_summary_of_the_volume_there_is_the_range_of_the_functions(scene, tmp_path, caplog, text):
    (tmp_path / "volume/volume.json").write_text(text)
    with caplog.at_level(logging.WARNING, "texgs.viewer"):
        transfer = Origins(named(scene, tmp_path)).transfer
    assert (transfer["minimum"], transfer["maximum"], transfer["histogram"]) == (1, 3, [])
    assert caplog.text.count("volume.json") == 1
    assert "without" in caplog.text


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


def test_a_picture_fits_into_a_frame():
    pixels = np.zeros((10, 20, 3), np.uint8)
    pixels[2:8, 4:16] = 200
    framed = fitted(pixels, 40, 40)
    assert framed.shape == (40, 40, 3)
    assert (framed[:10] == 0).all()
    assert framed[20, 20].tolist() == [200, 200, 200]
