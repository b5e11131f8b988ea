"""What a cut scene shows: its twin, a slab of it over models, or models alone."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from tests.fields.surfels.test_composition import ball
from tests.scene.test_twin import HIGH, LOW, sphere_volume
from texgs.core.camera import orbit
from texgs.core.cuts import Box, Cuts, Plane
from texgs.fields.surfels.model_file import write_model
from texgs.fields.surfels.variants import write_texture
from texgs.scene.changes import apply_all
from texgs.scene.cut_view import SLAB, cut_view
from texgs.scene.frame import frame
from texgs.scene.scene import Scene, SceneModel
from texgs.scene.session import Session
from texgs.scene.twin import Twin, range_of
from texgs.volume.nrrd_file import open_grid

CAMERA = orbit(20, 10, 4, 30, 48, 48)
TOWARDS = Plane([1.0, 0.2, 0.0], 0.1)  # its face is seen
HALF = Cuts([TOWARDS])


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """Two balls with a sphere as their volume, cut by a plane that faces the camera."""
    folder = tmp_path_factory.mktemp("scene")
    files = {
        name: write_model(folder / f"{name}.safetensors", ball(n))
        for n, name in enumerate(("low", "high"), 1)
    }
    models = {name: SceneModel(file) for name, file in files.items()}
    return Scene(models, cuts=HALF, volume=sphere_volume(folder, low=LOW, high=HIGH))


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


def test_a_look_lies_beyond_a_slab_of_the_volume(styled):
    twin, composed = Twin(styled), styled.open()
    seen = cut_view(composed, CAMERA, styled, twin).color
    near, behind = slab(styled).depth_range
    far = range_of(styled.cuts, CAMERA).depth_range[1]
    hidden = twin.render(CAMERA, styled, composed.palettes, slab(styled)).alpha
    volume, models = (
        twin.render(CAMERA, styled, composed.palettes),
        models_within(styled, torch.stack([behind, far])),
    )
    is_opaque, is_clear = hidden > 0.99, hidden == 0
    assert min(int(is_opaque.sum()), int(is_clear.sum())) > 10
    assert (seen - volume.color)[is_opaque].abs().max() < 0.02
    torch.testing.assert_close(seen[is_clear], models[is_clear], atol=1e-6, rtol=0)
    assert bool((near < behind).any())


def slab(scene):
    """The rays of a cut as far as the slab behind a face goes."""
    cut = range_of(scene.cuts, CAMERA)
    near, far = cut.depth_range
    behind = near + SLAB * scene.volume.appearance.opacity_unit / CAMERA.rays().norm(dim=-1)
    return cut._replace(depth_range=torch.stack([near, torch.minimum(behind, far)]))


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


def test_positions_may_count_samples_of_the_volume(scene):
    session = Session(replace(scene, cuts=Cuts()))
    apply_all(session, ["cut=x,0v", "cut=-y,31v", "cut=z,15.5v", "cut.box=0v,0v,0v,31v,31v,31v"])
    low, high = open_grid(scene.volume.file).aabb
    places = [plane.offset for plane in session.scene.cuts.planes]
    assert places == pytest.approx([low[0], -high[1], 0.0])
    assert session.scene.cuts.box == Box(list(low), list(high))
