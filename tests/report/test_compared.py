"""A scene beside its volume and beside its fit, where matter hides light."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from PIL import Image

from tests.scene.balls import balls_in_a_volume
from texgs.core.camera import orbit
from texgs.core.lens import Lens
from texgs.core.light import Light
from texgs.fields.kinds import kinds
from texgs.fields.part_edit import PartEdit
from texgs.metrics.quality import compare
from texgs.report import before_after, compared
from texgs.report.compared import SideBySide, compare_views, write_light_figure
from texgs.scene.cut_view import cut_view, scene_and_fitted, scene_and_volume
from texgs.scene.session import Session
from texgs.scene.twin import Twin
from texgs.volume.cameras import sights

CAMERA = orbit(20, 10, 4, 30, 48, 48)
DARK = Light("directional", -60, 30, shadows=0.8, occlusion=0.6)


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """Two balls with a sphere as their volume, with shadows and occlusion."""
    return balls_in_a_volume(tmp_path_factory.mktemp("scene"), light=DARK)


def lit(scene):
    return replace(scene, light=scene.light.unhidden)


def test_a_scene_and_its_volume_both_have_shadows(scene):
    """Each is darker than without, and no brighter anywhere."""
    composed, twin = scene.open(), Twin(scene)
    pairs = zip(
        scene_and_volume(composed, CAMERA, scene, twin),
        scene_and_volume(composed, CAMERA, lit(scene), twin),
        strict=True,
    )
    for dark, light in pairs:
        assert float((light.color - dark.color).max()) > 0.1
        assert float((light.color - dark.color).min()) > -1e-5
        assert torch.equal(dark.alpha, light.alpha)
    comparison, shown = compare_views("dark", scene, composed, twin, [CAMERA])
    image, truth = scene_and_volume(composed, CAMERA, scene, twin)
    assert comparison.psnr == pytest.approx(compare(image, truth)["psnr"])
    np.testing.assert_array_equal(shown["volume"], truth.color.clamp(0, 1))


def test_a_scene_beside_its_fit_has_no_shadows_in_either(scene):
    """What differs is what was edited: without edits nothing does."""
    changed = replace(scene.models["low"], edit=PartEdit(opacity=0.5))
    edited = replace(scene, models={**scene.models, "low": changed})
    composed = scene.open()
    now, before = scene_and_fitted(composed, composed, CAMERA, edited, ("depth",))
    assert torch.equal(now.color, cut_view(composed, CAMERA, lit(edited), None).color)
    assert torch.equal(before.color, cut_view(composed, CAMERA, lit(scene), None).color)
    for light, told in ((DARK, ["both without shadows and occlusion"]), (DARK.unhidden, [])):
        beside = SideBySide(Session(replace(scene, light=light)), "fitted", 4)
        list(beside.frames([(CAMERA, replace(scene, light=light))]))
        _, changes, *more = beside.sentences
        assert changes.startswith("colours differ by 0.000 at most")
        assert more == told


def test_frames_beside_the_volume_are_those_with_shadows(scene):
    dark, light = (SideBySide(Session(each), "volume", 4) for each in (scene, lit(scene)))
    (dark_frame,), (light_frame,) = (
        list(beside.frames([(CAMERA, each)])) for beside, each in ((dark, scene), (light, lit(scene)))
    )
    assert np.abs(dark_frame.astype(int) - light_frame).max() > 25
    scores = compare(*Session(scene).beside(CAMERA, scene))
    assert f"whole picture: {scores['psnr']:.2f} dB" in dark.sentences[0]


def test_the_figure_of_light_and_shadow(scene, tmp_path, monkeypatch):
    """Its pictures are those of scene and volume under four lights, and its numbers those on the object."""
    grids, twin, composed = [], Twin(scene), scene.open()
    monkeypatch.setattr(compared, "write_grid", lambda path, rows, titles: grids.append((rows, titles)))
    write_light_figure(tmp_path / "shadows.png", lit(scene), composed, twin, Lens(width=32, height=32))
    ((rows, titles),) = grids
    assert [len(row) for row in rows.values()] == [4, 4]
    azimuth, polar = compared.SHADOWING_LIGHTS[1]
    light = Light("directional", azimuth, polar, compared.SHADOWS, compared.OCCLUSION)
    camera = orbit(compared.SHADOWED_SIDE, compared.POLAR, *Lens(width=32, height=32))
    pair = scene_and_volume(composed, camera, replace(scene, light=light), twin)
    plain = scene_and_volume(composed, camera, replace(scene, light=light.unhidden), twin)
    for name, render in zip(("scene", "volume"), pair, strict=True):
        np.testing.assert_array_equal(rows[name][1], render.color.clamp(0, 1))
    told = [compare(*each)["object_psnr"] for each in (pair, plain)]
    assert titles[1] == "(10°, 30°): {:.1f} dB\nwithout shadows: {:.1f} dB".format(*told)
    monkeypatch.undo()
    path = write_light_figure(tmp_path / "shadows.png", scene, composed, twin, Lens(width=32, height=32))
    with Image.open(path) as picture:
        assert picture.width > picture.height > 100


def test_the_light_from_the_side_of_an_edit_casts_the_shadows_of_its_scene(scene, tmp_path, monkeypatch):
    monkeypatch.setattr(before_after, "TURNTABLE_FRAMES", 2)
    grids = []
    monkeypatch.setattr(before_after, "write_grid", lambda path, rows, titles: grids.append(rows))
    surfels = kinds()["surfels"]
    before_after.write_before_and_after(scene, scene, surfels, Lens(), tmp_path, torch.device("cpu"), "balls")
    camera = sights(Lens().square(before_after.SIZE))["front"]
    turned = replace(scene, light=DARK.turned(*before_after.SIDE_LIGHT))
    np.testing.assert_array_equal(grids[0]["after"][3], Session(turned).frame(camera))
