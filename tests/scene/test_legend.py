"""The legend of a scene: what is visible, in its colours of now, and the values it stands for."""

from dataclasses import replace

import numpy as np
import pytest

from tests.scene.test_twin import LOW
from texgs.fields.part_edit import PartEdit
from texgs.scene.legend import SAMPLES, Entry, legend_of
from texgs.scene.scene import Scene, SceneModel, SceneSegment, SceneVolume
from texgs.volume.transfer import TransferFunction

LABEL = TransferFunction(((127.5, 0.95), (255, 0.95)), ((127.5, 0.2, 0.4, 0.6),), 3)
RAMP = TransferFunction(((15, 0), (40, 1), (75, 0)), ((15, 0, 0.5, 1), (75, 1, 0.5, 0)))
TFS = {"liver": LABEL, "bone": RAMP}
PALETTES = [(0.2, 0.4, 0.6), (0.5, 0.5, 0.5)]


@pytest.fixture
def scene(tmp_path):
    models = {name: SceneModel(tmp_path / f"{name}.safetensors") for name in TFS}
    return Scene(models, volume=SceneVolume(tmp_path / "volume.nrrd", TFS))


def edited(scene, name, **changes):
    return replace(scene, models={**scene.models, name: replace(scene.models[name], **changes)})


def test_a_label_has_its_colour_and_a_function_those_over_its_range(scene):
    label, ramp = legend_of(scene, PALETTES)
    assert label == Entry("liver", [(0.2, 0.4, 0.6)], "")
    assert (ramp.name, ramp.range) == ("bone", "15 to 75")
    shares = np.linspace(0, 1, SAMPLES)
    expected = np.stack([shares, np.full(SAMPLES, 0.5), 1 - shares], 1)
    assert np.allclose(ramp.colors, expected, atol=1e-4)


def test_palettes_move_colours_and_the_invisible_is_left_out(scene):
    changed = edited(scene, "liver", edit=PartEdit(palette=(0.9, 0.1, 0.2)))
    assert legend_of(changed, PALETTES)[0].colors == [(0.9, 0.1, 0.2)]
    moved = edited(scene, "bone", edit=PartEdit(palette=(0.5, 0.5, 0.75)))
    assert legend_of(moved, PALETTES)[1].colors[0] == (0.0, 0.5, 1.0)
    assert legend_of(moved, PALETTES)[1].colors[-1] == (1.0, 0.5, 0.25)
    for edit in (PartEdit(visible=False), PartEdit(opacity=0.0)):
        assert [each.name for each in legend_of(edited(scene, "liver", edit=edit), PALETTES)] == ["bone"]


def test_segments_have_a_line_where_their_palette_is_their_own(scene, tmp_path):
    file, own = tmp_path / "mask.safetensors", PartEdit(palette=(1, 0, 0))
    segments = {
        "same": SceneSegment(file),
        "own": SceneSegment(file, own),
        "hidden": SceneSegment(file, replace(own, visible=False)),
    }
    names = [each.name for each in legend_of(edited(scene, "liver", segments=segments), PALETTES)]
    assert names == ["liver", "liver/own", "bone"]
    rest = edited(scene, "liver", segments=segments, edit=PartEdit(visible=False))
    assert [each.name for each in legend_of(rest, PALETTES)] == ["liver/own", "bone"]


def test_models_without_a_volume_have_their_palette_alone(scene):
    alone = replace(scene, volume=None)
    assert legend_of(alone, PALETTES)[1] == Entry("bone", [(0.5, 0.5, 0.5)], "")
    assert [each.name for each in legend_of(alone, [(), PALETTES[1]])] == ["bone"], "no colour is known"


def test_a_function_of_an_image_is_no_label(scene):
    tfs = {"liver": LOW, "bone": RAMP}
    entries = legend_of(replace(scene, volume=replace(scene.volume, tfs=tfs)), PALETTES)
    assert entries[0].range == f"{LOW.support[0]:.4g} to {LOW.support[1]:.4g}"
    bright = replace(RAMP, opacity=((127.5, 0.0), (140.0, 0.6), (255.0, 0.6)))  # of 8 bits
    entries = legend_of(replace(scene, volume=replace(scene.volume, tfs={**tfs, "bone": bright})), PALETTES)
    assert entries[1].range == "127.5 to 255"
