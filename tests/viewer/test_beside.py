"""A scene beside its volume, or else beside its training views."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from tests.fields.surfels.test_composition import ball
from tests.scene.test_twin import HIGH, LOW, sphere_volume
from tests.viewer.training_views import LIGHT, PLACES, SIZE, camera_at, write_results
from texgs.core.cuts import Cuts, Plane
from texgs.core.errors import ArgumentError
from texgs.fields.part_edit import PartEdit
from texgs.fields.surfels.model_file import write_model
from texgs.raster.reference.losses import similarities
from texgs.scene.scene import Scene, SceneModel
from texgs.scene.session import Session
from texgs.scene.twin import Twin
from texgs.viewer.frames import Beside
from texgs.viewer.messages import Orbit, View
from texgs.viewer.origins import Origins

WIDE = 2 * SIZE


@pytest.fixture
def results(tmp_path):
    return write_results(tmp_path)


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """Two balls that claim to be a sphere."""
    folder = tmp_path_factory.mktemp("sphere")
    files = {name: folder / f"{name}.safetensors" for name in ("low", "high")}
    models = {name: SceneModel(write_model(file, ball(1))) for name, file in files.items()}
    volume = sphere_volume(folder, low=LOW, high=HIGH)
    return Scene(models, LIGHT, (0.9, 1.0, 0.8), volume=volume)


def view(mode, width=SIZE, **values):
    return View(Orbit((0.0, 0.0, 0.0), 80.0, 10.0, 5.0, 40.0, width, SIZE), mode=mode, **values)


def frame(scene, asked, scale=1.0):
    return Beside(Session(scene), Origins(scene)).frame(asked, scene, scale)


def only(scene, name):
    models = {key: replace(x, edit=PartEdit(visible=key == name)) for key, x in scene.models.items()}
    return replace(scene, models=models)


def test_the_volume_is_seen_from_where_the_camera_is_and_as_far_as_it_is_measured(scene):
    camera, session = view("truth", WIDE).camera.camera(), Session(scene)
    seen, scores = frame(scene, view("truth", WIDE))
    truth = Twin(scene).render(camera, scene, session.composition.palettes)
    assert (seen == np.rint(255 * truth.color.clamp(0, 1).numpy())).all()
    shown = session.frame(camera).astype(float) / 255
    squares = (shown - truth.color.numpy()) ** 2
    assert scores["psnr"] == pytest.approx(-10 * np.log10(squares.mean()), abs=0.05)  # dB: eight bits
    alpha = session.frame(camera, "alpha")[..., 0] / 255
    on_object = squares[(alpha > 0.01) | (truth.alpha.numpy() > 0.01)].mean()
    assert scores["object_psnr"] == pytest.approx(-10 * np.log10(on_object), abs=0.05)
    assert scores["object_psnr"] < scores["psnr"]
    expected = float(similarities(torch.from_numpy(shown), truth.color.double()).mean())
    assert scores["ssim"] == pytest.approx(expected, abs=0.01)
    assert scores["object_ssim"] < scores["ssim"]
    assert frame(scene, view("truth", moving=True), 0.5)[1] == {}, "it takes time, and is in motion"


def test_a_wipe_has_the_scene_to_the_left(scene):
    asked = view("wipe", wipe=0.25)
    (pair, _), (volume, _) = frame(scene, view("wipe")), frame(scene, view("truth"))
    shown = Session(scene).frame(asked.camera.camera())
    assert (pair == np.concatenate([shown, volume], 1)).all()
    assert (frame(scene, asked)[0] == np.concatenate([shown[:, :12], volume[:, 12:]], 1)).all()


def test_a_difference_has_a_sign_and_a_gain(scene):
    hidden = replace(only(scene, "none"), background=(1.0, 1.0, 1.0))
    seen, scores = frame(hidden, view("difference"))
    assert (seen >= 254).all(), "two empty pictures"
    assert scores == {"psnr": 100.0, "ssim": pytest.approx(1)}
    shown = Session(scene).frame(view("truth").camera.camera()).astype(int)
    error = shown - frame(scene, view("truth"))[0]
    worst = np.take_along_axis(error, np.abs(error).argmax(2, keepdims=True), 2)[..., 0]
    for gain in (1.0, 16.0):
        signed = frame(scene, view("difference", gain=gain))[0].astype(int)
        expected = (gain * worst).clip(-255, 255)
        assert (
            np.abs(signed[..., 2] - (255 - expected.clip(0))).max() <= 1 + gain
        )  # blue fades where too bright
        assert np.abs(signed[..., 0] - (255 + expected.clip(None, 0))).max() <= 1 + gain


def test_the_training_view_that_is_nearest_is_shown_without_a_volume(results):
    shown = only(results, "TF01")
    truth, scores = frame(shown, view("truth"))
    rendered = Session(shown).frame(camera_at(*PLACES[1]), scene=replace(shown, light=LIGHT))
    assert (truth == rendered).all()
    assert scores == {}
    wide = frame(shown, view("truth", width=WIDE))[0]
    assert (wide[:, SIZE // 2 : -SIZE // 2] == truth).all(), "the view is in the middle of a wide frame"
    assert (wide[:, : SIZE // 2] == truth[0, 0]).all()
    cut = replace(shown, cuts=Cuts([Plane([0.0, 1.0, 0.0])]))
    assert (frame(cut, view("difference"))[0] >= 250).all(), "its light is that of the view, and it is whole"
    entry = shown.models["TF01"]
    half = replace(shown, models={**shown.models, "TF01": replace(entry, edit=PartEdit(opacity=0.5))})
    assert frame(half, view("difference"))[0].min() < 200


def test_views_show_one_transfer_function(results):
    for shown in (results, only(results, "TF02"), only(results, "none")):
        with pytest.raises(ArgumentError, match="Training views show one transfer function each"):
            frame(shown, view("truth"))
    with pytest.raises(ArgumentError, match="expected a scene that names its volume"):
        frame(results, view("wipe"))


def test_what_there_is_to_show(scene, results, tmp_path):
    alone = Scene({"TF01": SceneModel(write_model(tmp_path / "a/b/c/d/e/f/model.safetensors", ball(1)))})
    modes = [Beside(Session(each), Origins(each)).modes for each in (scene, results, alone)]
    assert modes == [["volume", "difference", "wipe"], ["truth", "difference"], []]
