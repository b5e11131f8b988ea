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
from texgs.scene.twin import Twin

CAMERA = orbit(20, 10, 4, 30, 64, 48)
MIDDLE = (32, 24)
HALF = Cuts([Plane([1.0, 0.0, 0.0], 0.05)])  # keeps x up to 0.05


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return balls_in_a_volume(tmp_path_factory.mktemp("scene"))


@pytest.mark.parametrize("mode", ["shaded", "normal", "difference"])
def test_a_point_of_models_is_seen_at_its_pixel_at_their_mean_depth(scene, mode):
    """Without a volume, or where that is gone, or in modes that show models only."""
    gone = replace(scene, volume=replace(scene.volume, file=scene.volume.file.with_name("gone.nrrd")))
    for each in (scene,) if mode == "normal" else (replace(scene, volume=None), gone):
        point = torch.tensor(Session(each).point_at(CAMERA, mode, each, (30, 20)))
        place, z = CAMERA.project(point)
        torch.testing.assert_close(place, torch.tensor([30.5, 20.5]), atol=1e-3, rtol=0)
        depth = scene.open().render(CAMERA, scene.light, scene.edits, outputs=("depth",)).depth
        assert float(z) == pytest.approx(float(depth[20, 30]), abs=1e-4)


@pytest.mark.parametrize("mode", ["shaded", "difference"])
def test_a_point_is_where_half_of_the_light_is_gone_in_the_volume(scene, mode):
    solid = replace(scene.models["high"], edit=PartEdit(opacity=1.1))
    opaque = replace(scene, models={**scene.models, "high": solid})
    seen = Twin(opaque).render(CAMERA, opaque, opaque.open().palettes, outputs=("depth", "median"))
    assert float(seen.median[20, 30]) > 0
    point = torch.tensor(Session(opaque).point_at(CAMERA, mode, opaque, (30, 20)))
    assert float(CAMERA.project(point)[1]) == pytest.approx(float(seen.median[20, 30]), abs=1e-4)
    styled = replace(opaque, models={**opaque.models, "low": replace(solid, edit=PartEdit(ambient=0.5))})
    depth = styled.open().render(CAMERA, styled.light, styled.edits, outputs=("depth",)).depth
    point = torch.tensor(Session(styled).point_at(CAMERA, mode, styled, (30, 20)))
    assert float(CAMERA.project(point)[1]) == pytest.approx(float(depth[20, 30]), abs=1e-4)


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
