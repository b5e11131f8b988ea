from pathlib import Path

import numpy as np
import pytest
import torch

from tests.fields.surfels.test_composition import CAMERA, SIDE, ball
from tests.refusals import refused
from texgs.fields.part_edit import PartEdit
from texgs.fields.surfels.composition import Composition
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.shading import raw_material
from texgs.scene.frame import frame, relative_depth
from texgs.scene.scene import Scene, SceneModel


@pytest.fixture(scope="module")
def scene():
    return Composition([ball(1, n=1500)])


AS_FITTED = PartEdit()


def shot(composed, mode, edit=AS_FITTED, background=(1.0, 1.0, 1.0)):
    scene = Scene({"ball": SceneModel(Path(), edit)}, SIDE, background)
    return frame(composed, CAMERA, scene, mode)


def test_colour_is_what_is_rendered(scene):
    expected = scene.render(CAMERA, SIDE, background=torch.tensor([0.0, 0.5, 1.0])).color
    pixels = shot(scene, "shaded", background=(0.0, 0.5, 1.0))
    assert pixels.dtype == np.uint8
    assert np.abs(pixels / 255 - expected.numpy()).max() <= 0.5 / 255 + 1e-6
    assert pixels[0, 0].tolist() == [0, 128, 255]


def test_alpha_is_white_on_black_and_depth_grows_away_from_the_camera(scene):
    alpha, depth = shot(scene, "alpha"), shot(scene, "depth", background=(0.0, 0.0, 0.0))
    rendered = scene.render(CAMERA, SIDE, outputs=("depth",))
    assert alpha[0, 0].tolist() == [0, 0, 0]
    seen = rendered.alpha.numpy() > 0.99
    assert (alpha[seen] >= 252).all()
    order = np.argsort(rendered.depth.numpy()[seen])
    greys = depth[seen][:, 0].astype(int)
    assert np.corrcoef(np.arange(len(order)), greys[order])[0, 1] > 0.9
    assert greys.min() < 20
    assert 150 < greys.max() <= 230


def test_depth_of_a_translucent_scene_grows_away_from_the_camera(scene):
    model = ball(1, n=1500)
    faint = {**model.parameters, "opacities": torch.full((1500,), -4.6)}
    shown = Composition([Surfels(faint, model.shading)]).render(CAMERA, SIDE, outputs=("depth",))
    densest = float(shown.alpha.max())
    assert densest < 0.5
    depth = relative_depth(shown)[shown.alpha > 0.5 * densest]
    assert (float(depth.min()), float(depth.max())) == (0, 1)


def test_normals_of_a_flat_scene_are_one_colour():
    model = ball(1, n=400)
    p = {**model.parameters, "quats": torch.tensor([1.0, 0, 0, 0]).expand(400, 4)}
    scene = Composition([Surfels({**p, "opacities": torch.full((400,), 5.0)})])
    pixels = shot(scene, "normal")
    seen = scene.render(CAMERA, SIDE).alpha.numpy() > 0.99
    facing = 1 if CAMERA.position[2] > 0 else -1
    assert np.abs(pixels[seen] / 255 - (np.array([0, 0, facing]) + 1) / 2).max() < 0.02


def test_factors_are_grey_over_black():
    model = ball(1, n=1500)
    p = {**model.parameters, **raw_material(0.4, 0.5, 0.2, 20.0, "bounded")}
    scene = Composition([Surfels(p)])
    seen = scene.render(CAMERA, SIDE).alpha.numpy() > 0.995
    for mode, value in {"ambient": 0.4, "diffuse": 0.5, "specular": 0.2, "shininess": 0.2}.items():
        pixels = shot(scene, mode)
        assert pixels[0, 0].tolist() == [0, 0, 0]
        assert np.abs(pixels[seen] / 255 - value).max() < 0.01, mode


def test_nothing_to_see_is_the_background(scene):
    for mode in ("shaded", "normal", "depth"):
        pixels = shot(scene, mode, PartEdit(visible=False), (1.0, 0.0, 0.0))
        assert (pixels == [255, 0, 0]).all()


def test_a_mode_that_is_none(scene):
    refused(lambda: shot(scene, "colour"), "mode: expected one of shaded, volume, unshaded, normal")
