"""The volume edited as a scene is, and pictures of both as a gallery takes them."""

import numpy as np
import pytest
import torch

from tests.fields.surfels.test_composition import ball
from texgs.config.dataset import BasicTF
from texgs.config.views import Shading, ViewKeys
from texgs.core.camera import orbit
from texgs.core.errors import ArgumentError
from texgs.core.io import write_json
from texgs.core.light import Light
from texgs.fields.part_edit import PartEdit
from texgs.fields.surfels.composition import Composition
from texgs.fields.surfels.model_file import write_model
from texgs.scene.scene import Scene, SceneModel
from texgs.scene.scene_file import write_scene
from texgs.scene.session import Session
from texgs.volume.generate import sphere
from texgs.volume.prepare import prepare
from texgs.volume.slabs import ArraySource
from texgs.volume.transfer import TransferFunction
from texgs.workflow.stages.gallery import GalleryCell, GalleryRenderer
from texgs.workflow.stages.pse import compared
from texgs.workflow.stages.settings import FitLabel, OfScene
from texgs.workflow.stages.volume_scene import VolumeScene, edited

TF = TransferFunction(((0, 0), (1, 0.5), (2, 0.9)), ((0, 0.2, 0.4, 0.6), (2, 0.4, 0.6, 0.8)))
LOW = {"opacity": [[0.2, 0.0], [0.3, 0.4], [0.4, 0.0]], "color": [[0.2, 0.2, 0.3, 0.8]]}
SIZE = 48
VIEW = [20.0, 10.0]
HIGH = {"opacity": [[0.6, 0.0], [0.7, 0.9], [1.0, 0.9]], "color": [[0.6, 0.8, 0.5, 0.2]]}


def test_opacity_and_colour_of_a_transfer_function():
    tf = edited(TF, PartEdit(opacity=1.5, palette=(0.5, 0.5, 0.5)), (0.3, 0.5, 0.9))
    np.testing.assert_allclose(tf.opacity, [(0, 0), (1, 0.75), (17 / 12, 1), (2, 1)], err_msg="at most 1")
    np.testing.assert_allclose(tf.color, [(0, 0.4, 0.4, 0.2), (2, 0.6, 0.6, 0.4)])
    assert edited(TF, PartEdit(), ()) == TF


def test_what_an_edit_cuts_off_is_cut_off_at_every_value():
    """Also between points: the product is at most 1 there, and no lower."""
    values = np.linspace(0, 2, 41)
    tf = edited(TF, PartEdit(opacity=3.0, palette=(1.0, 0.0, 0.5)), (0.3, 0.5, 0.9))
    color, alpha = TF(values)[:, :3] + [0.7, -0.5, -0.4], 3 * TF(values)[:, 3]
    np.testing.assert_allclose(tf(values), np.clip(np.column_stack([color, alpha]), 0, 1), atol=1e-12)


@pytest.fixture(scope="module")
def of_scene(tmp_path_factory):
    """The settings of a job that shows a sphere, and its folder with volume.nrrd."""
    folder, grid = tmp_path_factory.mktemp("volume"), sphere(32)
    prepare(ArraySource(grid, "sphere"), folder / "volume.nrrd")
    bounds = {"minimum": float(grid.values.min()), "maximum": float(grid.values.max())}
    write_json(folder / "volume.json", bounds)
    label = {"name": "quick", "field": "surfels", "seed": 0, "sweep": "none", "variant": "", "device": "cpu"}
    settings = OfScene(
        stage="pse",
        dataset="sphere",
        stand_in="",
        tf_values="fraction",
        basic_tfs={"low": BasicTF(**LOW), "high": BasicTF(**HIGH)},
        views=ViewKeys(shading=Shading(), step=0.5, renderer="cpu", width=8, height=8),
        fit=FitLabel(**label, changed=False),
    )
    return settings, folder


@pytest.fixture(scope="module")
def volume(of_scene):
    settings, folder = of_scene
    return VolumeScene(settings, folder / "volume.nrrd")


@pytest.fixture(scope="module")
def renderer(of_scene):
    """Two balls for the basic TFs of the sphere, and its volume."""
    settings, folder = of_scene
    models = {
        name: SceneModel(write_model(folder / f"{name}.safetensors", ball(seed)))
        for seed, name in enumerate(("low", "high"), start=1)
    }
    scene = write_scene(folder / "scene.yaml", Scene(models))
    return GalleryRenderer(settings, {"quick/none": scene, "volume": folder / "volume.nrrd"}, SIZE)


CAMERA = orbit(20, 10, 4, 30, 48, 48)
PALETTES = {"low": (0.2, 0.3, 0.8), "high": (0.8, 0.5, 0.2)}
HIDDEN = PartEdit(visible=False)


def render(volume, light=Light("headlight"), **edits):  # noqa: B008
    """The volume with edits of its two basic TFs, in the order in which they are named."""
    edits = {"low": PartEdit(), "high": PartEdit()} | edits
    models = {name: SceneModel("x", edit) for name, edit in edits.items()}
    return volume.render(CAMERA, Scene(models, light), [PALETTES[name] for name in models])


def test_edits_are_those_of_the_basic_tf_of_their_name(volume):
    """A scene may name its models in another order than the job's settings, which are sorted."""
    models = {"high": SceneModel("x", PartEdit(opacity=0.2)), "low": SceneModel("x")}
    scene = Scene(models, Light("headlight"))
    shown = volume.render(CAMERA, scene, [PALETTES[name] for name in models])
    np.testing.assert_array_equal(shown, render(volume, high=PartEdit(opacity=0.2)))
    assert not np.array_equal(shown, render(volume, low=PartEdit(opacity=0.2)))


def test_every_edit_reaches_the_picture(volume):
    plain = render(volume)
    red = render(volume, low=PartEdit(palette=(0.9, 0.3, 0.1)))
    assert red[..., 0].sum() > 1.1 * plain[..., 0].sum()
    assert red[..., 2].sum() < 0.9 * plain[..., 2].sum()
    np.testing.assert_allclose(red[..., 3], plain[..., 3], atol=1e-3)
    faint = render(volume, low=PartEdit(opacity=0.2))
    assert faint[..., 3].sum() < plain[..., 3].sum()
    dim = PartEdit(ambient=0.2, diffuse=0.2, specular=0.0)
    dark = render(volume, low=dim, high=dim)
    assert dark[..., :3].sum() < 0.5 * plain[..., :3].sum()
    alone = render(volume, low=HIDDEN)
    assert alone[..., 3].sum() < plain[..., 3].sum()
    assert not render(volume, low=HIDDEN, high=HIDDEN).any()
    side = render(volume, Light("directional", 110, 0))
    assert np.abs(side - plain).max() > 0.1


def test_a_scene_is_compared_with_the_volume_that_has_its_edits(volume, monkeypatch):
    asked = []
    volume_render = volume.render
    monkeypatch.setattr(volume, "render", lambda *words: asked.append(words) or volume_render(*words))
    edits = [PartEdit(opacity=0.5), PartEdit(palette=(0, 1, 0))]
    models = {name: SceneModel("x", edit) for name, edit in zip(("low", "high"), edits, strict=True)}
    scene = Scene(models, Light("headlight"))
    comparison, shown = compared("both", scene, Composition([ball(1), ball(2)]), volume, [CAMERA])
    assert comparison.psnr > 0
    assert comparison.ssim < 1
    assert set(shown) == {"scene", "volume", "error"}
    assert asked[0][1] == scene
    torch.testing.assert_close(torch.tensor(asked[0][2][0]), ball(1).parameters["palette"])


def cell(show="scene", **changed):
    nothing = {"view": VIEW, "fov_y": None, "box": [], "pixels": None, "light": [], "changes": []}
    return GalleryCell(**{"scene": "quick/none", "show": show, **nothing, **changed})


def test_a_picture_is_a_frame_of_the_changed_scene(renderer):
    session = Session.open(renderer._inputs["quick/none"])
    session.set("low", "opacity", 0.5)
    session.set_light(Light("directional", -30.0, 40.0))
    expected = session.frame(orbit(*VIEW, 4.0311, 20.0, SIZE, SIZE))
    plain = renderer.render(cell()).pixels
    changed = renderer.render(cell(fov_y=20.0, light=[-30.0, 40.0], changes=["low.opacity=0.5"])).pixels
    np.testing.assert_array_equal(np.round(changed * 255), expected)
    np.testing.assert_array_equal(renderer.render(cell()).pixels, plain, "changes are taken back")
    assert np.abs(changed - plain).max() > 0.1
    assert renderer.render(cell("")).pixels is None, "a place may be empty"


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
