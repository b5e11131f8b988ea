"""Scenes with a new look, from the volume on, by hand: no weights are needed for any of it."""

import json
from dataclasses import replace

import numpy as np
import pytest
import torch
from PIL import Image

from tests.cli.conftest import ORBITAL as WORDS
from tests.cli.conftest import hide_weights, numbers
from tests.models.clips import write_clip
from texgs.cli.main import main
from texgs.core.errors import MissingDataError
from texgs.edit.methods.image import how
from texgs.edit.recipe import DEFAULT, preset
from texgs.scene.scene_file import read_scene

pytestmark = pytest.mark.stages

FEW = ("edit.image.iterations=3", "edit.segment.views=12", "edit.segment.size=96", "edit.text.size=64")
CLICK = ("edit=lobe", "edit.segment.model=TF01", "edit.segment.points=[[0.6, 0.4]]")


@pytest.fixture(scope="module")
def results(at, scene_of_two):
    """All kinds of edits, and their measures."""
    part = ("edit.base=lobe", "edit.parts=[TF01/lobe]")
    verbs = (
        ("edit_image", "edit=glass"),
        ("edit_text", "edit=gold"),
        ("edit_segment", *CLICK),
        ("edit_image", "edit=glass", *part, "edit.name=part"),
        ("edit_text", "edit=crimson", *part),
        ("edit_metrics", "edit=glass"),
    )
    at(scene_of_two.parent, *([verb, *WORDS, *FEW, *words] for verb, *words in verbs))
    return scene_of_two / "orbital" / "scene" / "demo"


@pytest.fixture(autouse=True)
def beside(results, tmp_path, monkeypatch):
    """Where the results are, without weights."""
    monkeypatch.chdir(results.parents[3])
    hide_weights(monkeypatch, tmp_path)


def parameters(results, scene, name):
    return read_scene(results / scene / "scene.yaml").models[name].open()[0].parameters


@pytest.mark.parametrize("edit", ["glass", "gold"])
def test_only_colours_change(results, edit):
    for name in ("TF01", "TF02"):
        before, after = parameters(results, "compose", name), parameters(results, f"edits/{edit}", name)
        same = {key for key in before if torch.equal(before[key], after[key])}
        assert same == set(before) - {"texels", "colors"}


def test_pictures_show_both(results):
    for edit, files in {
        "glass": ("style.png", "edit.png", "convergence.png"),
        "gold": ("views.png", "edit.png"),
        "lobe": ("edit.png",),
    }.items():
        for name in files:
            picture = np.asarray(Image.open(results / "edits" / edit / name).convert("RGB"))
            assert picture.std() > 5, f"{edit}/{name} shows nothing"
    told = json.loads((results / "edits" / "lobe" / "metrics.json").read_text())["pictures"]["edit.png"]
    assert "only pieces that hold a click" in told, "else its mask shows more than the segment"
    assert (results / "edits" / "glass" / "turntable.mp4").stat().st_size > 1000


def test_numbers_name_the_method(results):
    glass, gold = (numbers(results / "edits" / edit) for edit in ("glass", "gold"))
    assert glass["how"] == "patches (no weights)"
    assert gold["how"] == "procedural filters, default"
    assert set(glass["notes"]["seconds"]) == {"TF01", "TF02"}
    assert glass["edit_seconds"] > 0
    assert {part.split("/")[0] for part in glass["losses"]} == {"TF01", "TF02"}
    assert all(len(losses) == min(100, glass["iterations"]) for losses in glass["losses"].values())
    assert gold["losses"] == {}
    assert json.loads((results / "edits" / "glass" / "metrics.json").read_text())["seed"] == 0


def test_looks_are_shown_side_by_side(results):
    assert main(["gallery", *WORDS, *FEW, "edits=[glass,gold]", "gallery.size=32"]) == 0
    folder = results.parents[1] / "gallery" / "looks"
    shown = [(each["row"], each["column"]) for each in numbers(folder)["shown"]]
    columns = ["volume", "as fitted", "glass", "gold"]
    assert shown == [(row, column) for row in ("front", "below", "above") for column in columns]
    assert np.asarray(Image.open(folder / "gallery.png").convert("RGB")).std() > 5
    looks = ("edits=[glass,gold]", "edit.looks=true", "dataset.looks={TF01: {}, TF02: {}}")
    assert main(["gallery", *WORDS, *FEW, *looks, "gallery.size=32", "gallery.name=given"]) == 0
    given = folder.with_name("given") / "gallery.png"
    assert Image.open(given).height > 1.2 * Image.open(folder / "gallery.png").height
    told = json.loads(given.with_name("metrics.json").read_text())["pictures"]["gallery.png"]
    assert "what they were given" in told


@pytest.mark.parametrize("edit", ["part", "crimson"])
def test_a_part_of_a_model_is_edited_alone(results, edit):
    models = read_scene(results / "edits" / edit / "scene.yaml").models
    before, after = parameters(results, "compose", "TF01"), parameters(results, f"edits/{edit}", "TF01")
    (mask,) = models["TF01"].open()[1]
    assert 0 < int(mask.sum()) == numbers(results / "edits" / "lobe")["notes"]["surfels"]
    counts = before["sizes"].long().prod(1)
    owner = torch.repeat_interleave(counts)
    changed = (before["texels"] != after["texels"]).any(1)
    assert bool(changed[mask[owner]].any())
    assert not bool(changed[~mask[owner]].any())
    assert torch.equal(before["colors"][~mask], after["colors"][~mask])
    assert models["TF02"].texture is None


def test_measures_without_weights_say_what_is_missing(results):
    metrics = numbers(results / "edit_metrics" / "glass")
    assert metrics["geometry_kept"] is True
    assert (metrics["width"], metrics["height"]) == (48, 48)
    assert "clip-vit-base-patch32 are not on this machine" in metrics["clip_missing"]
    assert "similarity" not in metrics
    assert 0 <= metrics["short_rmse"] <= 0.2
    assert "short_lpips" not in metrics
    assert metrics["megabytes"] > 0


@pytest.mark.parametrize(
    ("verb", "words", "message"),
    [
        ("edit_text", ["edit=glass"], "edit.method: expected text, got image (edit=glass)"),
        ("edit_image", ["edit=glass", "edit.image.recipe=default"], "vgg16: its weights"),
        ("edit_text", ["edit=gold", "edit.text.instruction=fur"], "instruction: expected one of stipple"),
    ],
)
def test_a_mistake_leaves_the_earlier_result(results, capsys, monkeypatch, verb, words, message):
    monkeypatch.setattr("texgs.models.weights._download", no_network)
    folder = results / "edits" / words[0].removeprefix("edit=")
    before = {path.name: path.stat().st_mtime_ns for path in folder.iterdir()}
    assert main([verb, *WORDS, *FEW, *words, "--replace"]) == 2
    assert message in capsys.readouterr().err
    assert {path.name: path.stat().st_mtime_ns for path in folder.iterdir()} == before


def no_network(name, entry):
    raise MissingDataError(f"{name}: its weights are not on this machine, and a download failed")


def test_another_picture_in_the_same_file_is_another_style(results, tmp_path, monkeypatch):
    style, folder = tmp_path / "mine.png", results / "edits" / "mine"
    words = [*WORDS, *FEW, "edit=glass", f"edit.image.style={style}", "edit.name=mine"]
    times = []
    for level in (0, 0, 255):
        if not times or level:
            Image.new("RGB", (64, 64 + level), (level, 0, 0)).save(style)
        assert main(["edit_image", *words]) == 0
        times.append((folder / "TF01.safetensors").stat().st_mtime_ns)
    assert times[0] == times[1], "nothing has changed"
    assert times[1] != times[2]


def test_the_style_of_an_object_of_a_picture(results, tmp_path, monkeypatch, capsys):
    pixels = np.full((90, 120, 3), 240, dtype=np.uint8)
    pixels[20:70, 30:90] = (200, 30, 20)
    Image.fromarray(pixels).save(tmp_path / "red.png")
    words = (f"edit.image.style={tmp_path / 'red.png'}", "edit.image.masks=grabcut", "edit.name=red")
    region = "edit.image.region=[[0.5, 0.5]]"
    assert main(["edit_image", *WORDS, *FEW, "edit=glass", *words, region]) == 0
    style = np.asarray(Image.open(results / "edits" / "red" / "style.png"))[..., :3]
    assert style[..., 1].mean() < 90, "the box around the object"


def test_training_views_can_vote(results, monkeypatch):
    words = ("edit.segment.voters=training", "edit.segment.vote=centre", "edit.name=trained")
    assert main(["edit_segment", *WORDS, *FEW, *CLICK, *words]) == 0
    told = numbers(results / "edits" / "trained")
    transforms = json.loads((results.parents[1] / "TF01" / "views" / "transforms_train.json").read_text())
    assert sum(told["notes"]["views"].values()) == len(transforms["frames"]) + 1, "and the one clicked on"
    assert told["how"] == "grabcut, centre"


def test_the_papers_edit_by_a_picture_runs_where_clip_is_there(results, tmp_path, monkeypatch):
    """With random weights in the real format, as the loss alone: VGG has to be the published one."""
    monkeypatch.setenv("TEXGS_WEIGHTS", str(tmp_path))
    write_clip(tmp_path / "clip-vit-base-patch32")
    words = ("edit=style_paper", "edit.image.lambda_s=0", "edit.name=clip")
    assert main(["edit_image", *WORDS, *FEW, *words]) == 0
    told = numbers(results / "edits" / "clip")
    assert (told["how"], told["lambda_s"]) == ("clip-vit-base-patch32", 0)
    before, after = (parameters(results, scene, "TF01") for scene in ("compose", "edits/clip"))
    assert not torch.equal(before["texels"], after["texels"])


def test_a_scene_file_can_be_edited(results, tmp_path, capsys, monkeypatch):
    base = f"edit.base={results / 'edits' / 'lobe' / 'scene.yaml'}"
    words = (base, "edit.parts=[TF01/lobe]", "edit.name=other")
    assert main(["edit_image", *WORDS, *FEW, "edit=glass", *words]) == 0
    assert read_scene(results / "edits" / "other" / "scene.yaml").models["TF01"].segments["lobe"].texture
    assert main(["edit_image", *WORDS, *FEW, "edit=glass", "edit.base=none.yaml"]) == 2
    assert "edit.base: none.yaml is not there" in capsys.readouterr().err


def test_tables_name_the_clip_of_the_loss():
    paper = preset("paper")
    assert how([paper], "clip-vit-large-patch14") == "VGG-16 + clip-vit-large-patch14"
    assert how([replace(paper, lambda_s=1.0)], "clip-vit-large-patch14") == "VGG-16"
    translucent = DEFAULT.adapted(0.5)
    assert how([translucent], "") == "VGG-16", "patches do not count in translucent scenes"
    assert how([translucent, DEFAULT], "") == "VGG-16 + patches"
    assert how([replace(paper, lambda_s=0.0)], "clip-vit-base-patch32") == "clip-vit-base-patch32"
