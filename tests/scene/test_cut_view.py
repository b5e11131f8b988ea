"""What a cut scene shows: its twin, a slab of it over models, or models alone."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.ndimage import distance_transform_cdt

from tests.fields.surfels.test_composition import ball
from tests.scene.balls import balls_in_a_volume
from texgs.core.camera import orbit
from texgs.core.cuts import Box, Cuts, Plane
from texgs.fields.surfels.variants import write_texture
from texgs.scene.changes import apply_all
from texgs.scene.cut_view import (
    FACE_ALPHA,
    FACE_UNITS,
    HIDDEN_ALPHA,
    SLAB_UNITS,
    STEP,
    cut_view,
    grow_softly,
    slab_of,
    slab_thickness,
)
from texgs.scene.frame import frame
from texgs.scene.session import Session
from texgs.scene.twin import Twin, range_of
from texgs.volume.nrrd_file import open_grid

CAMERA = orbit(20, 10, 4, 30, 96, 96)
TOWARDS = Plane([1.0, 0.2, 0.0], 0.1)  # its face is seen
HALF = Cuts([TOWARDS])


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """Two balls with a sphere as their volume, cut by a plane that faces the camera."""
    return balls_in_a_volume(tmp_path_factory.mktemp("scene"), cuts=HALF)


@pytest.fixture(scope="module")
def styled(scene, tmp_path_factory):
    """The same with a look."""
    texture = write_texture(tmp_path_factory.mktemp("look") / "look.safetensors", ball(1))
    return replace(scene, models={**scene.models, "low": replace(scene.models["low"], texture=texture)})


def models_within(scene, depth_range):
    composed, background = scene.open(), torch.tensor(scene.background)
    options = {"background": background, "depth_range": depth_range}
    return composed.render(CAMERA, scene.light, scene.edits, **options).color


def test_a_scene_without_looks_shows_its_twin(scene):
    composed, twin = scene.open(), Twin(scene)
    seen = cut_view(composed, CAMERA, scene, twin).color
    assert torch.equal(seen, twin.render(CAMERA, scene, composed.palettes).color)
    whole = twin.render(CAMERA, replace(scene, cuts=Cuts()), composed.palettes).color
    assert not torch.equal(seen, whole)


@pytest.mark.parametrize(
    "word", ["low/part.visible=false", "low/part.palette=#ff0000", "high.ambient=0.2", "high.shininess=0.1"]
)
def test_edits_that_a_volume_cannot_show_stay_below_a_cut(scene, word, tmp_path):
    session = Session(replace(scene, cuts=Cuts([Plane([1.0, 0.0, 0.0], 3.0)])))  # takes nothing away
    mask = torch.arange(len(scene.models["low"].surfels()[0])) % 2 == 0
    session.make_segment("low/part", mask, tmp_path / "part.safetensors", {})
    before = session.frame(CAMERA).astype(float)
    apply_all(session, [word])
    whole = session.frame(CAMERA, scene=replace(session.scene, cuts=Cuts())).astype(float)
    assert np.abs(whole - before).mean() > 0.5
    assert np.abs(session.frame(CAMERA).astype(float) - whole).mean() < 0.05


def test_what_all_parts_have_is_shown_by_the_volume(scene):
    edits = replace(scene.models["low"].edit, ambient=0.5)
    alike = {name: replace(entry, edit=edits) for name, entry in scene.models.items()}
    assert replace(scene, models=alike).is_as_volume
    hidden = replace(scene.models["high"], edit=replace(edits, visible=False, diffuse=0.0))
    assert replace(scene, models={**alike, "high": hidden}).is_as_volume


def test_a_look_lies_beyond_a_slab_of_the_volume(styled):
    """Behind faces there is the volume, away from them there are models only; between lies a rim."""
    twin, composed = Twin(styled), styled.open()
    seen = cut_view(composed, CAMERA, styled, twin).color
    cut = range_of(styled.cuts, CAMERA)
    soon = slab(styled, cut, FACE_UNITS)
    is_face = twin.render(CAMERA, styled, composed.palettes, soon).alpha >= FACE_ALPHA
    deep = slab(styled, cut, SLAB_UNITS)
    is_opaque = is_face & (twin.render(CAMERA, styled, composed.palettes, deep).alpha > 0.99)
    volume = twin.render(CAMERA, styled, composed.palettes)
    away = distance_transform_cdt(~is_face.numpy(), "chessboard")
    is_far = torch.from_numpy(away) > 12  # pixels; the rim ends after two coarse ones, interpolated
    models = models_within(styled, cut.depth_range)
    assert min(int(is_opaque.sum()), int((is_far & (models != 1).any(dim=-1)).sum())) > 10
    assert (seen - volume.color)[is_opaque].abs().max() < 0.02
    torch.testing.assert_close(seen[is_far], models[is_far], atol=1e-6, rtol=0)
    assert (seen - models)[is_face].abs().max() > 0.1


def slab(scene, cut, units):
    """The rays of a cut as far as so many opacity units behind a face."""
    near, far = cut.depth_range
    behind = near + units * scene.volume.appearance.opacity_unit / CAMERA.rays().norm(dim=-1)
    return cut._replace(depth_range=torch.stack([near, torch.minimum(behind, far)]))


def test_weights_grow_and_then_fall_softly():
    mask = torch.zeros(40, 50)
    mask[20, 25] = mask[0, 0] = 1
    weights = grow_softly(mask, 3).numpy()
    away = distance_transform_cdt(mask.numpy() == 0, "chessboard")
    assert np.allclose(weights[away <= 3], 1)
    assert not weights[away > 6].any()
    assert ((weights > 0) & (weights < 1))[(away > 3) & (away <= 6)].all()
    assert np.abs(np.diff(weights, axis=0)).max() <= 1 / 4 + 1e-6  # a quarter a pixel
    assert torch.equal(grow_softly(mask, 0), mask)


def test_the_slab_fades_out_where_matter_becomes_faint(styled):
    """No pixel of a face jumps from the volume to the models: slabs get shorter with the alpha of a face."""
    twin, composed = Twin(styled), styled.open()
    thickness, part = slab_thickness(composed, CAMERA, styled, twin)
    weights = torch.zeros(CAMERA.height, CAMERA.width)
    weights[part] = thickness * CAMERA.ray_lengths()[part] / (SLAB_UNITS * twin.opacity_unit)
    steps = torch.maximum(weights.diff(dim=0).abs()[:, :-1], weights.diff(dim=1).abs()[:-1])
    assert (float(weights.min()), float(weights.max())) == pytest.approx((0, 1), abs=1e-3)
    assert steps.max() < 0.35  # a rim of one coarse pixel falls over two of them


@pytest.mark.parametrize("box", [(0, 0, 96, 96), (41, 3, 90, 94), (50, 50, 81, 83)])
def test_only_the_part_with_faces_is_cast_and_nothing_else_changes(styled, box):
    """Of any size, and where faces are cut off by the border, as if the slab were cast in all pixels."""
    camera, twin, composed = CAMERA.crop(*box), Twin(styled), styled.open()
    thickness, part = slab_thickness(composed, camera, styled, twin)
    whole = torch.zeros(camera.height, camera.width)
    assert thickness.numel() < whole.numel() or box != (0, 0, 96, 96)
    whole[part] = thickness
    cut = range_of(styled.cuts, camera)
    slab = slab_of(cut, whole)
    front = twin.with_step(STEP).cast(camera, styled, composed.palettes, slab).rgba
    behind, far = slab.depth_range[1], cut.depth_range[1]
    beyond = torch.stack([behind, torch.where(front[..., 3] < HIDDEN_ALPHA, far, behind)])
    options = {"background": torch.tensor(styled.background), "depth_range": beyond}
    models = composed.render(camera, styled.light, styled.edits, **options).color
    expected = front[..., :3] + (1 - front[..., 3:]) * models
    torch.testing.assert_close(cut_view(composed, camera, styled, twin).color, expected, atol=1e-4, rtol=0)


def test_where_a_plane_meets_nothing_there_is_no_slab(styled):
    beyond = replace(styled, cuts=Cuts([Plane([1.0, 0.2, 0.0], 2.0)]))
    twin, composed = Twin(styled), styled.open()
    assert not slab_thickness(composed, CAMERA, beyond, twin)[0].any()
    models = models_within(beyond, range_of(beyond.cuts, CAMERA).depth_range)
    assert torch.equal(cut_view(composed, CAMERA, beyond, twin).color, models)


@pytest.mark.parametrize("mode", ["shaded", "normal", "depth", "ambient"])
def test_without_a_volume_models_are_clipped(scene, mode):
    bare = replace(scene, volume=None)
    cut = frame(bare.open(), CAMERA, bare, mode)
    whole = frame(bare.open(), CAMERA, replace(bare, cuts=Cuts()), mode)
    assert not np.array_equal(cut, whole)
    if mode == "shaded":
        expected = models_within(bare, range_of(bare.cuts, CAMERA).depth_range)
        assert np.abs(cut / 255 - expected.numpy()).max() <= 0.5 / 255 + 1e-6


def test_a_box_that_holds_all_changes_nothing_but_rounding(scene):
    large = replace(scene, cuts=Cuts(box=Box([-3.0] * 3, [3.0] * 3)))
    uncut = replace(scene, cuts=Cuts())
    for twin in (None, Twin(scene)):
        seen = cut_view(scene.open(), CAMERA, large, twin).color
        expected = cut_view(scene.open(), CAMERA, uncut, None).color
        if twin:
            expected = twin.render(CAMERA, uncut, scene.open().palettes).color
        torch.testing.assert_close(seen, expected, atol=1e-4, rtol=0)


def test_a_session_shows_cuts_and_takes_them_back(scene, tmp_path):
    session = Session(replace(scene, cuts=Cuts()))
    before = session.frame(CAMERA)
    session.set_of_scene("cuts", {"planes": [{"normal": [1, 0.2, 0], "offset": 0.1}]})
    cut = session.frame(CAMERA)
    assert np.array_equal(cut, frame(scene.open(), CAMERA, session.scene, twin=Twin(scene)))
    assert np.array_equal(Session.open(session.save(tmp_path / "cut.yaml")).frame(CAMERA), cut)
    session.undo()
    assert np.array_equal(session.frame(CAMERA), before)


def test_a_session_may_cast_coarser(scene):
    session = Session(scene)
    coarse = session.frame(CAMERA, step=1.0)
    assert not np.array_equal(coarse, session.frame(CAMERA))
    assert np.array_equal(coarse, frame(scene.open(), CAMERA, scene, twin=Twin(scene).with_step(1.0)))


def test_positions_may_count_samples_of_the_volume(scene):
    session = Session(replace(scene, cuts=Cuts()))
    apply_all(session, ["cut=x,0v", "cut=-y,31v", "cut=z,15.5v", "cut.box=0v,0v,0v,31v,31v,31v"])
    low, high = open_grid(scene.volume.file).aabb
    places = [plane.offset for plane in session.scene.cuts.planes]
    assert places == pytest.approx([low[0], -high[1], 0.0])
    assert session.scene.cuts.box == Box(list(low), list(high))
