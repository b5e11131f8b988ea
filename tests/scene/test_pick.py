"""The point that a pixel shows, against depths of whole frames and places that are known."""

from dataclasses import replace

import pytest
import torch

from tests.scene.balls import balls_in_a_volume
from texgs.core.camera import orbit
from texgs.core.cuts import NO_CUTS, Cuts, Plane
from texgs.core.light import Light
from texgs.fields.part_edit import PartEdit
from texgs.scene.session import Session

CAMERA = orbit(20, 10, 4, 30, 64, 48)
MIDDLE = (32, 24)
HALF = Cuts([Plane([1.0, 0.0, 0.0], 0.05)])  # keeps x up to 0.05


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return balls_in_a_volume(tmp_path_factory.mktemp("scene"))


@pytest.mark.parametrize("mode", ["shaded", "normal", "difference"])
def test_a_point_of_models_is_seen_at_its_pixel_at_their_mean_depth(scene, mode):
    point = torch.tensor(Session(scene).point_at(CAMERA, mode, scene, (30, 20)))
    place, z = CAMERA.project(point)
    torch.testing.assert_close(place, torch.tensor([30.5, 20.5]), atol=1e-3, rtol=0)
    depth = scene.open().render(CAMERA, scene.light, scene.edits, outputs=("depth",)).depth
    assert float(z) == pytest.approx(float(depth[20, 30]), abs=1e-4)


@pytest.mark.parametrize("mode", ["shaded", "normal", "volume"])
@pytest.mark.parametrize("cuts", [NO_CUTS, HALF])
def test_shadows_move_no_point(scene, mode, cuts):
    cut = replace(scene, cuts=cuts)
    shadowed = replace(cut, light=Light("directional", 30.0, 40.0, 1.0, 1.0))
    places = [Session(each).point_at(CAMERA, mode, each, MIDDLE) for each in (cut, shadowed)]
    assert places[0] == places[1]


@pytest.mark.parametrize("mode", ["shaded", "volume"])
def test_there_is_no_point_on_the_background(scene, mode):
    assert Session(scene).point_at(CAMERA, mode, scene, (0, 0)) is None
    hidden = {name: replace(model, edit=PartEdit(visible=False)) for name, model in scene.models.items()}
    assert Session(scene).point_at(CAMERA, mode, replace(scene, models=hidden), MIDDLE) is None


def test_a_point_of_the_volume_is_on_the_side_of_the_camera(scene):
    point = torch.tensor(Session(scene).point_at(CAMERA, "volume", scene, MIDDLE))
    towards = CAMERA.position / CAMERA.position.norm()
    assert 0.05 < float(point @ towards) < 0.5


def test_a_point_of_a_cut_is_on_its_face_where_faces_are_shown(scene):
    camera, cut = orbit(10, 10, 4, 30, 64, 48), replace(scene, cuts=HALF)
    x = {mode: Session(cut).point_at(camera, mode, cut, MIDDLE)[0] for mode in ("shaded", "volume", "normal")}
    assert x["shaded"] == pytest.approx(0.05, abs=0.02)  # some opacity units behind the face
    assert x["volume"] == x["shaded"]
    assert x["normal"] < -0.05, "hollow models show their far side"
