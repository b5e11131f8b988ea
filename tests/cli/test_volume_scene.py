import numpy as np
import pytest
import torch

from tests.fields.surfels.test_composition import ball
from texgs.config.dataset import BasicTF
from texgs.config.views import Shading, ViewKeys
from texgs.core.camera import orbit
from texgs.core.io import write_json
from texgs.core.light import Light
from texgs.fields.part_edit import PartEdit
from texgs.fields.surfels.composition import Composition
from texgs.scene.scene import Scene, SceneModel
from texgs.volume.generate import sphere
from texgs.volume.prepare import prepare
from texgs.volume.slabs import ArraySource
from texgs.volume.transfer import TransferFunction
from texgs.workflow.stages.pse import Step, compared
from texgs.workflow.stages.settings import FitLabel, OfScene
from texgs.workflow.stages.volume_scene import VolumeScene, edited

TF = TransferFunction(((0, 0), (1, 0.5), (2, 0.9)), ((0, 0.2, 0.4, 0.6), (2, 0.4, 0.6, 0.8)))
LOW = {"opacity": [[0.2, 0.0], [0.3, 0.4], [0.4, 0.0]], "color": [[0.2, 0.2, 0.3, 0.8]]}
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
def volume(tmp_path_factory):
    folder = tmp_path_factory.mktemp("volume")
    grid = sphere(32)
    prepare(ArraySource(grid, "sphere"), folder / "volume.nrrd")
    bounds = {"minimum": float(grid.values.min()), "maximum": float(grid.values.max())}
    write_json(folder / "volume.json", bounds)
    views = ViewKeys(shading=Shading(), step=0.5, mapper="cpu")
    basic = {"low": BasicTF(**LOW), "high": BasicTF(**HIGH)}
    fit = FitLabel("quick", "surfels", 0, "none", "", "cpu", False)
    return VolumeScene(OfScene("pse", "sphere", "", "fraction", basic, views, fit), folder / "volume.nrrd")


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


def test_a_scene_is_compared_with_the_volume_that_has_its_edits(volume):
    asked = []
    volume_render = volume.render
    fake = type("V", (), {"render": lambda self, *words: asked.append(words) or volume_render(*words)})()
    edits = [PartEdit(opacity=0.5), PartEdit(palette=(0, 1, 0))]
    models = {name: SceneModel("x", edit) for name, edit in zip(("low", "high"), edits, strict=True)}
    step = Step("both", Scene(models, Light("headlight")))
    comparison, shown = compared(step, Composition([ball(1), ball(2)]), fake, [CAMERA])
    assert comparison.psnr > 0
    assert comparison.ssim < 1
    assert set(shown) == {"scene", "volume", "error"}
    assert asked[0][1] == step.scene
    torch.testing.assert_close(torch.tensor(asked[0][2][0]), ball(1).parameters["palette"])
