"""Scenes, models and words of the command line that mean harm, or were damaged."""

import json
import lzma

import numpy as np
import pytest
import torch
import yaml
from PIL import Image
from safetensors.torch import save, save_file

from tests.edit.tasks import task
from tests.fields.surfels.samples import sample
from tests.fields.surfels.test_composition import ball
from texgs.cli.main import main
from texgs.core.errors import ArgumentError, OutOfMemoryError
from texgs.fields.surfels.compact import read_compact, write_compact
from texgs.fields.surfels.model_file import write_model
from texgs.scene.scene import Scene, SceneModel
from texgs.scene.scene_file import read_scene, write_scene
from texgs.scene.segment_file import read_segment, write_segment
from texgs.volume.tf_plot import plot


@pytest.fixture
def scene(tmp_path):
    path = write_model(tmp_path / "m.safetensors", ball(1))
    return write_scene(tmp_path / "scene.yaml", Scene({"TF01": SceneModel(path)}))


def refused(capsys, *words):
    """What the command line says about a mistake, in one line that a terminal can show."""
    assert main([str(word) for word in words]) == 2
    message = capsys.readouterr().err.splitlines()[0]
    assert message.isprintable()
    assert message.startswith(f"texgs {words[0]}: ")
    return message


def test_a_name_of_a_model_is_no_way_out_of_the_folder(tmp_path):
    path = write_model(tmp_path / "m.safetensors", ball(1))
    hostile = Scene({"../../outside": SceneModel(path)})
    folder = tmp_path / "a" / "b"
    with pytest.raises(ArgumentError, match=r"edit.parts: expected a name that a file can have"):
        task(hostile, folder).each_part(lambda part, model, surfels, views: model)
    assert sorted(x.name for x in tmp_path.rglob("*.safetensors")) == ["m.safetensors"]


def test_aliases_that_stand_for_gigabytes(scene, capsys):
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 8)}]" for i in range(1, 9)]
    scene.write_text("\n".join(lines))
    assert "scene.yaml: expected values, got an alias (*name) in line 2" in refused(capsys, "render", scene)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda v: v["models"].update({"a\x1b[2J": v["models"]["TF01"]}),
            "models: expected a name of 1 to 100",
        ),
        (
            lambda v: v["models"]["TF01"].update(opacity=10**400),
            "models.TF01.opacity: expected a factor from 0",
        ),
        (lambda v: v.update(light={"azimuth": 10**400, "polar": 0}), "light: expected headlight"),
        (lambda v: v.update(background=[[[0]]] * 9), "background: expected three numbers"),
    ],
)
def test_values_that_no_scene_has(scene, capsys, change, message):
    values = yaml.safe_load(scene.read_text())
    change(values)
    scene.write_text(json.dumps(values))  # is YAML, without aliases
    assert message in refused(capsys, "render", scene)


def test_an_edit_that_could_not_be_opened_writes_nothing(scene, tmp_path, capsys):
    (tmp_path / "foreign").write_text("root:x:0:0")
    for word in (f"TF01/x={tmp_path / 'foreign'}", f"TF01.texture={tmp_path / 'foreign'}"):
        assert "foreign: expected a texgs-" in refused(
            capsys, "edit", scene, word, "--output", tmp_path / "x.yaml"
        )
        assert not (tmp_path / "x.yaml").exists()


def test_numbers_with_an_exponent(scene, tmp_path):
    assert main(["edit", str(scene), "TF01.opacity=5e-1", "--output", str(tmp_path / "x.yaml")]) == 0
    assert read_scene(tmp_path / "x.yaml").models["TF01"].edit.opacity == 0.5


def test_anchors_that_are_no_places_belong_to_no_model(tmp_path):
    model = sample()
    path = write_segment(tmp_path / "s", model, torch.arange(7) < 3)
    header = {"texgs-segment": json.dumps({"version": 1, "metadata": {}})}
    anchors = torch.full((7, 3), torch.nan)
    save_file({"mask": torch.arange(7) < 3, "anchors": anchors}, path, header)
    with pytest.raises(ArgumentError, match="expected a segment of this model"):
        read_segment(path, model)


def test_a_compact_file_that_unpacks_to_more_than_there_is(tmp_path):
    path = write_compact(tmp_path / "m.texgs", sample())
    line = path.read_bytes().partition(b"\n")[0]
    tensors = save({"codes": torch.zeros(8, dtype=torch.uint8)})
    start = json.dumps({"codes": {"dtype": "U8", "shape": [2**50], "data_offsets": [0, 2**50]}}).encode()
    path.write_bytes(line + b"\n" + lzma.compress(len(start).to_bytes(8, "little") + start + tensors))
    with pytest.raises(
        OutOfMemoryError, match=r"m\.texgs: a model of 1125899906842624 bytes, as its header says"
    ):
        read_compact(path)
    many = save({"codes": torch.zeros(8, dtype=torch.uint8)}) + bytes(300_000_000)
    path.write_bytes(line + b"\n" + lzma.compress(many, preset=0))
    with pytest.raises(ArgumentError, match=r"got 8 bytes of tensors, expected 8|cut short or damaged"):
        read_compact(path)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--frames", "1000000000", "--path", "orbit"], "--frames: expected at most 100000, got 1000000000"),
        (["--width", "300000"], "GiB of memory, but"),
        (["--mode", "normal", "--width", "300000"], "a frame of 300000 x 300000 pixels: needs 5364 GiB"),
    ],
)
def test_pictures_and_films_beyond_the_memory(scene, tmp_path, capsys, words, message):
    assert message in refused(capsys, "render", scene, "--output", tmp_path / "x.mp4", *words)
    assert not (tmp_path / "x.mp4").exists()


def test_titles_are_no_mathematics(tmp_path):
    from texgs.volume.transfer import TransferFunction

    tf = TransferFunction(((0, 0.0), (1, 1.0)), ((0, 1.0, 0.0, 0.0),))
    path = plot(tmp_path / "a.png", np.ones(8), 0, 1, {"$x_{$": tf}, title="$\\frac{$ 5 $")
    assert Image.open(path).size == (1000, 450)
