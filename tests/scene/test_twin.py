"""The volume edited as a scene is, and what a scene file says of it."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
import yaml

from tests.fields.surfels.test_composition import ball
from tests.refusals import refused
from texgs.core.camera import orbit
from texgs.core.cuts import Cuts, Plane
from texgs.core.errors import ArgumentError
from texgs.core.light import Light
from texgs.fields.part_edit import PartEdit
from texgs.fields.surfels.model_file import write_model
from texgs.scene.scene import Scene, SceneModel, SceneVolume
from texgs.scene.scene_file import read_scene, write_scene
from texgs.scene.session import Session
from texgs.scene.twin import Twin, edit_function
from texgs.volume.caster import Caster
from texgs.volume.generate import sphere
from texgs.volume.nrrd_file import open_grid
from texgs.volume.prepare import prepare
from texgs.volume.render import Appearance
from texgs.volume.slabs import ArraySource
from texgs.volume.transfer import TransferFunction, combine

TF = TransferFunction(((0, 0), (1, 0.5), (2, 0.9)), ((0, 0.2, 0.4, 0.6), (2, 0.4, 0.6, 0.8)))
LOW = TransferFunction(((0.2, 0), (0.3, 0.4), (0.4, 0)), ((0.2, 0.2, 0.3, 0.8),))  # of the range of the data
HIGH = TransferFunction(((0.6, 0), (0.7, 0.9), (1, 0.9)), ((0.6, 0.8, 0.5, 0.2),))
CAMERA = orbit(20, 10, 4, 30, 48, 48)
PALETTES = {"low": (0.2, 0.3, 0.8), "high": (0.8, 0.5, 0.2)}
HIDDEN = PartEdit(visible=False)
LOOK = Appearance(ambient=0.4, diffuse=0.55, specular=0.21, shininess=12, step=0.5, opacity_unit=0.007)


def sphere_volume(folder, **fractions):
    """A prepared sphere with basic TFs by name, which are given on the range of its values."""
    grid = sphere(32)
    prepare(ArraySource(grid, "sphere"), folder / "volume.nrrd")
    low, high = float(grid.values.min()), float(grid.values.max())
    tfs = {name: tf.scaled(low, high) for name, tf in fractions.items()}
    return SceneVolume(folder / "volume.nrrd", tfs, LOOK)


@pytest.fixture(scope="module")
def volume(tmp_path_factory):
    return sphere_volume(tmp_path_factory.mktemp("volume"), low=LOW, high=HIGH)


@pytest.fixture(scope="module")
def twin(volume):
    return Twin(scene_of(volume))


def scene_of(volume, light=Light("headlight"), **edits):  # noqa: B008
    """A scene with edits of the two basic TFs, in the order in which they are named."""
    edits = {"low": PartEdit(), "high": PartEdit()} | edits
    return Scene({name: SceneModel(Path("x"), edit) for name, edit in edits.items()}, light, volume=volume)


def render(twin, light=Light("headlight"), **edits):  # noqa: B008
    """Premultiplied RGBA of the twin of such a scene."""
    scene = replace(scene_of(twin._volume, light, **edits), background=(0.0, 0.0, 0.0))
    seen = twin.render(CAMERA, scene, [PALETTES[name] for name in scene.models])
    return torch.cat([seen.color, seen.alpha[..., None]], dim=-1).numpy()


def test_opacity_and_colour_of_a_transfer_function():
    tf = edit_function(TF, PartEdit(opacity=1.5, palette=(0.5, 0.5, 0.5)), (0.3, 0.5, 0.9))
    np.testing.assert_allclose(tf.opacity, [(0, 0), (1, 0.75), (17 / 12, 1), (2, 1)], err_msg="at most 1")
    np.testing.assert_allclose(tf.color, [(0, 0.4, 0.4, 0.2), (2, 0.6, 0.6, 0.4)])
    assert edit_function(TF, PartEdit(), ()) == TF


def test_what_an_edit_cuts_off_is_cut_off_at_every_value():
    """Also between points: the product is at most 1 there, and no lower."""
    values = np.linspace(0, 2, 41)
    tf = edit_function(TF, PartEdit(opacity=3.0, palette=(1.0, 0.0, 0.5)), (0.3, 0.5, 0.9))
    color, alpha = TF(values)[:, :3] + [0.7, -0.5, -0.4], 3 * TF(values)[:, 3]
    np.testing.assert_allclose(tf(values), np.clip(np.column_stack([color, alpha]), 0, 1), atol=1e-12)


def test_edits_are_those_of_the_basic_tf_of_their_name(twin):
    """A scene may name its models in another order than its transfer functions."""
    models = {"high": SceneModel("x", PartEdit(opacity=0.2)), "low": SceneModel("x")}
    shown = twin.render(CAMERA, Scene(models), [PALETTES[name] for name in models])
    np.testing.assert_array_equal(shown.alpha, render(twin, high=PartEdit(opacity=0.2))[..., 3])
    assert not np.array_equal(shown, render(twin, low=PartEdit(opacity=0.2)))


def test_every_edit_reaches_the_picture(twin):
    plain = render(twin)
    red = render(twin, low=PartEdit(palette=(0.9, 0.3, 0.1)))
    assert red[..., 0].sum() > 1.1 * plain[..., 0].sum()
    assert red[..., 2].sum() < 0.9 * plain[..., 2].sum()
    np.testing.assert_allclose(red[..., 3], plain[..., 3], atol=1e-3)
    faint = render(twin, low=PartEdit(opacity=0.2))
    assert faint[..., 3].sum() < plain[..., 3].sum()
    dim = PartEdit(ambient=0.2, diffuse=0.2, specular=0.0)
    dark = render(twin, low=dim, high=dim)
    assert dark[..., :3].sum() < 0.5 * plain[..., :3].sum()
    alone = render(twin, low=HIDDEN)
    assert alone[..., 3].sum() < plain[..., 3].sum()
    assert not render(twin, low=HIDDEN, high=HIDDEN).any()
    side = render(twin, Light("directional", 110, 0))
    assert np.abs(side - plain).max() > 0.1


def test_the_twin_is_the_volume_as_views_show_it(volume, twin):
    """Bit by bit what the caster shows with the same transfer functions, light and material."""
    light = Light("directional", 110, 20)
    caster = Caster(open_grid(volume.file), LOOK)
    np.testing.assert_array_equal(render(twin, light), caster.render(combine(volume.tfs), CAMERA, light))
    alone = caster.render(volume.tfs["high"], CAMERA, light)
    np.testing.assert_allclose(render(twin, light, low=HIDDEN), alone, atol=1e-6)


@pytest.mark.parametrize("tint", [(1.0, 0.5, 0.2), (0.5, 0.5, 0.0)])
def test_each_channel_has_its_share_of_the_highlight(twin, tint):
    """Bit by bit that of a white highlight which is as much weaker."""
    edit, light = PartEdit(specular=3.0, shininess=2.0, tint=tint), Light("directional", 110, 20)
    shown = render(twin, light, low=edit, high=edit)
    for channel, share in enumerate(tint):
        weaker = PartEdit(specular=3.0 * share, shininess=2.0)
        expected = render(twin, light, low=weaker, high=weaker)
        np.testing.assert_allclose(shown[..., channel], expected[..., channel], atol=1e-7)
        np.testing.assert_array_equal(shown[..., 3], expected[..., 3])
    assert np.abs(shown - render(twin, light, low=replace(edit, tint=(1, 1, 1)))).max() > 0.1


def test_no_opacity_is_hidden(twin):
    np.testing.assert_array_equal(render(twin, low=PartEdit(opacity=0)), render(twin, low=HIDDEN))


def test_the_background_is_that_of_the_scene(twin):
    scene = replace(scene_of(None, low=HIDDEN, high=HIDDEN), background=(0.2, 0.4, 0.6))
    assert torch.equal(twin.render(CAMERA, scene, [(), ()]).color[0, 0], torch.tensor([0.2, 0.4, 0.6]))
    seen = twin.render(CAMERA, replace(scene, models=scene_of(None).models), [(), ()])
    assert torch.equal(seen.color[0, 0], torch.tensor([0.2, 0.4, 0.6]))
    assert seen.alpha.max() > 0.5


def test_scene_files_name_their_volume(tmp_path, volume, twin):
    path = write_scene(tmp_path / "scenes" / "scene.yaml", scene_of(volume))
    opened = read_scene(path).volume
    assert replace(opened, file=opened.file.resolve()) == replace(volume, file=volume.file.resolve())
    session = Session.open(path)
    session.set_light(Light("directional", 110, 0))
    other = read_scene(session.save(tmp_path / "other.yaml"))
    seen = Twin(other).render(CAMERA, other, list(PALETTES.values()))
    assert np.array_equal(seen.alpha, render(twin)[..., 3]), "and edits keep it"


def test_a_twin_without_what_it_needs(tmp_path, volume, twin):
    old = read_scene(write_scene(tmp_path / "old.yaml", scene_of(None)))
    refused(lambda: Twin(old), r"volume: expected the volume that the .* by texgs compose")
    moved = scene_of(replace(volume, file=tmp_path / "none.nrrd"))
    refused(lambda: Twin(moved), r"volume: .*none\.nrrd: no such file; texgs volume ")
    strange = Scene({"other": SceneModel("x")})
    refused(lambda: twin.render(CAMERA, strange, [()]), r"volume\.tfs: .*other, got low, h")


def test_basic_tfs_of_other_models_are_told_where_a_scene_is_opened(volume):
    """The border that opens a scene names its file; a frame that is rendered later does not."""
    low = volume.tfs["low"]
    refused(lambda: Twin(scene_of(replace(volume, tfs={"low": low}))), r"^volume\.tfs: .*high, got low;")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"file": 3}, "volume.file: expected the path of a volume, got 3"),
        ({"stap": 0.5}, "volume: no such key 'stap', did you mean step?"),
        ({"step": 0}, "volume.step: expected a number above 0, got 0"),
        ({"ambient": -1}, "volume.ambient: expected a number from 0, got -1"),
        ({"shininess": "high"}, "volume.shininess: expected a number from 0, got 'high'"),
        ({"opacity_unit": 10**400}, "volume.opacity_unit: expected a number above 0"),
        ({"tfs": None}, "volume.tfs: expected a table of keys and values, got None"),
        ({"tfs": {"low": 3}}, "volume.tfs.low: transfer function: expected the keys opacity, color, got "),
        ({"tfs": {"low": {"opacity": [[0, 2]], "color": []}}}, "volume.tfs.low: opacity: "),
    ],
)
def test_a_mistake_is_named_with_its_place(tmp_path, volume, change, message):
    path = write_scene(tmp_path / "scene.yaml", scene_of(volume))
    values = yaml.safe_load(path.read_text())
    path.write_text(json.dumps({**values, "volume": {**values["volume"], **change}}))
    with pytest.raises(ArgumentError, match=message) as error:
        read_scene(path)
    assert str(error.value).isprintable()


PEAK = TransferFunction(((0.35, 0), (0.45, 0.6), (0.65, 0)), ((0.35, 0.9, 0.2, 0.1),))  # over both basic TFs


def peak(volume):
    """A function that overlaps both basic ones, in data values."""
    values = [value for tf in volume.tfs.values() for value in tf.support]
    low = (min(values) - 0.2 * max(values)) / 0.8  # LOW begins at a fifth of the range, HIGH ends with it
    return PEAK.scaled(low, max(values))


def shows(scene, functions):
    """What the twin of a scene shows with functions that are tried."""
    palettes = [PALETTES[name] for name in scene.models]
    return Twin(scene).render(CAMERA, scene, palettes, functions=functions)


def low_of(volume, tf):
    """A scene of one model, of a basic TF."""
    return replace(scene_of(replace(volume, tfs={"low": tf})), models={"low": SceneModel(Path("x"))})


def test_a_function_that_is_tried_takes_the_place_of_a_basic_one(volume):
    one = shows(low_of(volume, volume.tfs["low"]), {"low": peak(volume)})
    assert torch.equal(one.color, shows(low_of(volume, peak(volume)), {}).color)


def test_functions_that_overlap_are_cast_together(volume):
    """A function beside the basic ones is seen where they are, as the same matter twice is twice as dense."""
    seen, basic = (shows(scene_of(volume), tried).color for tried in ({"new": peak(volume)}, {}))
    assert (seen - basic).abs().max() > 0.02, "it lies below opaque matter"
    low = volume.tfs["low"]
    values = np.linspace(*low.support, 41)
    double = TransferFunction([*zip(values, 1 - (1 - low(values)[:, 3]) ** 2, strict=True)], low.color)
    dense, expected = shows(low_of(volume, low), {"again": low}), shows(low_of(volume, double), {})
    assert (dense.color - expected.color).abs().max() < 0.01


def test_functions_of_hidden_models_are_hidden_and_others_are_shown(volume):
    scene = scene_of(volume, low=HIDDEN, high=HIDDEN)
    assert float(shows(scene, {"low": peak(volume)}).alpha.max()) == 0
    assert float(shows(scene, {"new": peak(volume)}).alpha.max()) > 0.5


def test_the_mode_volume_alone_shows_what_is_tried(volume, tmp_path):
    file = write_model(tmp_path / "ball.safetensors", ball(1))
    cut = Cuts([Plane([1.0, 0.2, 0.0], 0.1)])
    scene = replace(scene_of(volume), models={name: SceneModel(file) for name in ("low", "high")}, cuts=cut)
    tried, session = replace(scene, functions={"new": peak(volume)}), Session(scene)
    assert not np.array_equal(*(session.frame(CAMERA, "volume", each) for each in (scene, tried)))
    assert np.array_equal(*(session.frame(CAMERA, "shaded", each) for each in (scene, tried))), "and faces"
    assert torch.equal(*(session.beside(CAMERA, each)[1].color for each in (scene, tried)))


def test_a_scene_file_keeps_the_functions_that_are_tried(volume, tmp_path):
    scene = replace(scene_of(volume), functions={"low": peak(volume), "TF 3": peak(volume)})
    scene = replace(scene, models={name: SceneModel(volume.file) for name in scene.models})
    again = read_scene(write_scene(tmp_path / "scene.yaml", scene))
    assert again.functions == scene.functions


@pytest.mark.parametrize(
    ("functions", "message"),
    [
        ([], "functions: expected a table of keys and values, got \\[\\]"),
        ({"a": {"opacity": [[0, 1]]}}, "functions.a: .* the keys opacity"),
        ({"a": {"opacity": [[1, 0], [0, 1]], "color": [[0, 0, 0, 0]]}}, "functions.a: .*expected ascending"),
        ({"": PEAK.to_dict()}, "functions: expected a name of 1 to 100 printable letters"),
        ({f"n{i}": PEAK.to_dict() for i in range(33)}, "functions: expected at most 32, got 33"),
    ],
)
def test_functions_that_are_none(volume, functions, message):
    session = Session(scene_of(volume))
    refused(lambda: session.set_of_scene("functions", functions), message)
    assert session.scene.functions == {}


def test_functions_are_tried_and_taken_back(volume):
    session = Session(scene_of(volume))
    session.set_of_scene("functions", {"new": peak(volume).to_dict()})
    assert list(session.scene.functions) == ["new"]
    session.undo()
    assert session.scene.functions == {}
