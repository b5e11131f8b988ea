"""Pictures of scenes and their volume as a gallery takes them."""

import numpy as np
import pytest
import torch

from tests.fields.surfels.test_composition import ball
from tests.scene.test_twin import HIGH, LOW, sphere_volume
from texgs.config.gallery import GalleryCell
from texgs.core.camera import orbit
from texgs.core.errors import ArgumentError
from texgs.core.lens import Frame
from texgs.core.light import Light
from texgs.fields.part_edit import PartEdit
from texgs.fields.surfels.composition import Composition
from texgs.fields.surfels.model_file import write_model
from texgs.report.compared import compare_views
from texgs.report.gallery import GalleryRenderer
from texgs.scene.scene import Scene, SceneModel
from texgs.scene.scene_file import write_scene
from texgs.scene.session import Session
from texgs.scene.twin import Twin
from texgs.volume.view_settings import ViewKeys

SIZE = 48
VIEW = [20.0, 10.0]
FRAME = Frame([0.1, 0.0, 0.0], 0.8)


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """Two balls for the basic TFs of a sphere."""
    folder = tmp_path_factory.mktemp("scene")
    models = {
        name: SceneModel(write_model(folder / f"{name}.safetensors", ball(seed)))
        for seed, name in enumerate(("low", "high"), start=1)
    }
    return Scene(models, volume=sphere_volume(folder, low=LOW, high=HIGH), frame=FRAME)


@pytest.fixture(scope="module")
def renderer(scene):
    file = write_scene(scene.volume.file.with_name("scene.yaml"), scene)
    return GalleryRenderer({"quick/none": file}, ViewKeys().fov_y, SIZE, torch.device("cpu"))


def test_a_scene_is_compared_with_the_volume_that_has_its_edits(scene, monkeypatch):
    twin, asked = Twin(scene), []
    render = twin.render
    monkeypatch.setattr(twin, "render", lambda *words: asked.append(words) or render(*words))
    edits = [PartEdit(opacity=0.5), PartEdit(palette=(0, 1, 0))]
    models = {name: SceneModel("x", edit) for name, edit in zip(("low", "high"), edits, strict=True)}
    changed, camera = Scene(models, Light("headlight")), orbit(20, 10, 4, 30, 48, 48)
    comparison, shown = compare_views("both", changed, Composition([ball(1), ball(2)]), twin, [camera])
    assert comparison.psnr > 0
    assert comparison.ssim < 1
    assert set(shown) == {"scene", "volume", "error"}
    assert asked[0][1] == changed
    torch.testing.assert_close(torch.tensor(asked[0][2][0]), ball(1).parameters["palette"])


def cell(show="scene", **changed):
    nothing = {"view": VIEW, "fov_y": None, "box": [], "pixels": None, "light": []}
    nothing |= {"legend": False, "changes": []}
    return GalleryCell(**{"scene": "quick/none", "show": show, **nothing, **changed})


def test_a_picture_is_a_frame_of_the_changed_scene(renderer):
    session = Session.open(renderer._scenes["quick/none"])
    session.set("low", "opacity", 0.5)
    session.set_light(Light("directional", -30.0, 40.0))
    lens = FRAME.lens().square(SIZE)
    expected = session.frame(orbit(*VIEW, *lens._replace(fov_y=20.0)))
    plain = renderer.render(cell()).pixels
    changed = renderer.render(cell(fov_y=20.0, light=[-30.0, 40.0], changes=["low.opacity=0.5"])).pixels
    np.testing.assert_array_equal(np.round(changed * 255), expected)
    np.testing.assert_array_equal(renderer.render(cell()).pixels, plain, "changes are taken back")
    assert np.abs(changed - plain).max() > 0.1
    assert renderer.render(cell("")).pixels is None, "a place may be empty"


def test_a_picture_may_have_a_legend(renderer):
    plain, named = (renderer.render(cell(legend=legend)).pixels for legend in (False, True))
    differs = (plain != named).any(axis=2)
    assert differs.any()
    assert not differs.all(), "the rest stays"


@pytest.mark.parametrize("show", ["scene", "volume"])
def test_a_picture_may_have_shadows(renderer, show):
    side, words = [-30.0, 40.0], ["shadows=1", "occlusion=0.5"]
    plain, shadowed = (renderer.render(cell(show, light=side, changes=each)).pixels for each in ([], words))
    assert shadowed.mean() < plain.mean()
    lit = [*words, f"light={side[0]},{side[1]}"]
    np.testing.assert_array_equal(renderer.render(cell(show, changes=lit)).pixels, shadowed)


@pytest.mark.parametrize("show", ["scene", "volume"])
def test_a_box_is_cut_out_of_a_larger_view(renderer, show):
    box = renderer.render(cell(show, box=[0.25, 0.5, 0.25])).pixels
    assert box.shape == (SIZE, SIZE, 3)
    renderer._size *= 4
    whole = renderer.render(cell(show)).pixels
    renderer._size //= 4
    np.testing.assert_array_equal(box, whole[2 * SIZE : 3 * SIZE, SIZE : 2 * SIZE])


def test_pixels_of_a_view_are_enlarged(renderer):
    half = renderer.render(cell(pixels=SIZE // 2)).pixels
    small = renderer.render(cell(box=[0.0, 0.5, 0.5], pixels=SIZE // 2)).pixels
    np.testing.assert_array_equal(half, half[::2, ::2].repeat(2, 0).repeat(2, 1))
    np.testing.assert_array_equal(small, half[SIZE // 2 :: 2, : SIZE // 2 : 2].repeat(4, 0).repeat(4, 1))
    assert np.abs(half - renderer.render(cell()).pixels).max() > 0


def test_an_error_is_that_of_the_worst_channel_with_its_psnr(renderer):
    words = {"light": [-30.0, 40.0], "changes": ["high.palette=0.2,0.9,0.3"]}
    scene, volume = (
        renderer.render(cell(show, **words)).pixels.astype(float) for show in ("scene", "volume")
    )
    error = renderer.render(cell("error", **words))
    assert error.psnr == pytest.approx(-10 * np.log10(((scene - volume) ** 2).mean()), abs=1e-3)
    signed = np.take_along_axis(scene - volume, np.abs(scene - volume).argmax(2)[..., None], 2)[..., 0]
    red, blue = error.pixels[..., 0] - error.pixels[..., 2], np.abs(signed) > 0.02
    assert np.array_equal(np.sign(red[blue]), np.sign(signed[blue])), "red is too bright"
    assert renderer.render(cell("volume", **words)).psnr is None


def test_a_change_that_cannot_be_made_is_named_and_leaves_nothing(renderer):
    before = renderer.render(cell()).pixels
    with pytest.raises(ArgumentError, match=r"low.opacity=-1: models.low.opacity: expected a factor from 0"):
        renderer.render(cell(changes=["high.visible=false", "low.opacity=-1"]))
    np.testing.assert_array_equal(renderer.render(cell()).pixels, before)
