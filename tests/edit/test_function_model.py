"""Models of functions that a scene tries, from the command line and in the viewer."""

import threading
from dataclasses import replace

import pytest

from tests.fields.gaussians.samples import sample as gaussians
from tests.fields.surfels.test_composition import ball
from tests.fitting.short_fits import shorten
from tests.scene.test_twin import HIGH, LOW, peak, sphere_volume
from tests.viewer.pages import on_page
from texgs.cli.main import main
from texgs.core.errors import ArgumentError
from texgs.edit.function_model import fit_function, overlap_of, tried_function, with_model
from texgs.fields.gaussians import write_gaussians
from texgs.fields.part_edit import PartEdit
from texgs.fields.surfels.model_file import write_model
from texgs.scene.scene import Scene, SceneModel
from texgs.scene.scene_file import read_scene, write_scene
from texgs.scene.series_file import Series
from texgs.scene.session import Session
from texgs.scene.twin import Twin


@pytest.fixture
def scene_file(tmp_path, monkeypatch):
    """A scene of a sphere that tries a function over both basic ones; fits take a moment."""
    shorten(monkeypatch, frequency=1, surfels=600, iterations=20)
    models = {
        name: SceneModel(write_model(tmp_path / f"{name}.safetensors", ball(1))) for name in ("low", "high")
    }
    volume = sphere_volume(tmp_path, low=LOW, high=HIGH)
    scene = Scene(models, volume=volume, functions={"new": peak(volume), "low": peak(volume)})
    return write_scene(tmp_path / "scene.yaml", scene)


def test_a_model_takes_the_place_of_its_function(scene_file):
    scene = read_scene(scene_file)
    low = replace(scene.models["low"], edit=PartEdit(opacity=0.5))
    scene = replace(scene, models={**scene.models, "low": low})
    file = scene.models["high"].file
    made = with_model(
        with_model(scene, "new", file, tried_function(scene, "new")),
        "low",
        file,
        tried_function(scene, "low"),
    )
    assert list(made.models) == ["low", "high", "new"]
    assert made.models["low"] == SceneModel(file, PartEdit(opacity=0.5))
    assert (made.functions, made.volume.tfs["new"]) == ({}, scene.functions["new"])
    assert "shows values of low, high as well" in overlap_of(made, "new")
    assert overlap_of(scene, "high") == ""
    Twin(made)  # basic functions may overlap


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["old"], "scene.yaml: functions: expected one that the scene tries (new, low), got old"),
        (["new", "--size", "2"], "--size: expected at least 16, got 2"),
        (["a/b"], "NAME: expected a name without"),
    ],
)
def test_what_cannot_be_fitted(scene_file, capsys, words, message):
    output = scene_file.with_name("made.yaml")
    assert main(["model", str(scene_file), *words, "--output", str(output)]) == 2
    assert message in capsys.readouterr().err
    assert not output.exists()


def test_scenes_that_no_model_can_join_are_refused(scene_file, tmp_path):
    scene, file = read_scene(scene_file), write_gaussians(tmp_path / "g.safetensors", gaussians(20))
    series = Series(scene_file.with_name("series.json"), ["a", "b"], ["new"])
    others = {
        "volume: expected": replace(scene, volume=None),
        r"models\.high: expected surfels": replace(scene, models={**scene.models, "high": SceneModel(file)}),
        "new has a model for each step": replace(scene, series=series),
    }
    for words, other in others.items():
        with pytest.raises(ArgumentError, match=words):
            next(fit_function(Session(other), "new", scene_file.with_name))


def test_the_command_line_writes_the_scene_and_one_model(scene_file, capsys):
    output = scene_file.with_name("made.yaml")
    words = ["--output", str(output), "--size", "48"]
    assert main(["model", str(scene_file), "new", *words]) == 0
    assert capsys.readouterr().out.startswith(f"{output} It shows values of low, high as well")
    made = read_scene(output)
    assert list(made.models) == ["low", "high", "new"]
    assert [each.name for each in output.parent.glob("made-*")] == [made.models["new"].file.name]
    assert made.open().parts[2].palette is not None


@on_page
async def test_the_viewer_adds_a_first_model_and_then_a_finer_one(browser, client, scene_file):
    await browser.send(type="fit", function="new")
    news = await browser.past("new model")
    assert [each["name"] for each in news["scene"]["models"]] == ["low", "high", "new"]
    assert "new" in news["scene"]["tfs"]
    assert list(news["scene"]["functions"]) == ["low"]
    news = await browser.past("new model", "new finer model")
    first = client.server_side.edits.scene.models["new"].file
    await browser.send(type="undo")
    await browser.past("new model")
    assert client.server_side.edits.scene.models["new"].file != first
    await browser.send(type="edit", part="new", key="opacity", value=0.5)
    await browser.past("new model", "new opacity 0.5")
    await browser.send(type="fit", function="old")
    while "expected one that the scene tries (low), got old" not in (await browser.next("notice"))["text"]:
        pass


def held(monkeypatch, *before_each):
    """Let the viewer wait for an event before each model that it makes."""

    def models(*_):
        for event in before_each:
            event.wait(30)
            yield ball(1)

    monkeypatch.setattr("texgs.edit.function_model.models_of", models)


async def notice(browser, text):
    while text not in (await browser.next("notice"))["text"]:
        pass


@on_page
async def test_a_model_of_a_function_that_was_changed_is_not_added(browser, client, scene_file, monkeypatch):
    held(monkeypatch, changed := threading.Event())
    await browser.send(type="fit", function="new")
    await browser.next("job")  # it has begun
    await browser.send(type="edit", part="", key="functions", value={})
    await browser.past("functions {}")
    changed.set()
    await notice(browser, "new: its function was changed meanwhile; make the model again")
    assert "new" not in client.server_side.edits.scene.models


@on_page
async def test_a_first_model_stays_where_the_finer_one_is_cancelled(browser, client, scene_file, monkeypatch):
    (first := threading.Event()).set()
    held(monkeypatch, first, cancelled := threading.Event())
    await browser.send(type="fit", function="new")
    await browser.past("new model")
    await browser.send(type="cancel")
    await browser.next("trial")
    cancelled.set()
    await notice(browser, "new: the finer model was cancelled; the first one stays.")


@on_page
async def test_a_model_that_is_undone_meanwhile_gets_no_finer_one(browser, client, scene_file):
    await browser.send(type="fit", function="new")
    await browser.past("new model")
    await browser.send(type="undo")
    while (await browser.next("job"))["done"] is not None:
        pass
    assert client.server_side.edits.scene.functions.keys() == {"new", "low"}
    assert len(list(scene_file.parent.glob("scene-new*"))) == 1
