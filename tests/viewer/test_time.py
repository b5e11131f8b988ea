"""A series on a page: its steps by name, the step that is shown, and what all pages see of it."""

from dataclasses import replace

import numpy as np
import pytest

from tests.scene.balls import ball_models
from tests.viewer.pages import on_page
from tests.viewer.test_downloads import VIEW
from tests.viewer.test_looks import SHOT
from texgs.fields.surfels.step_file import write_step
from texgs.scene.scene import Scene
from texgs.scene.scene_file import read_scene, write_scene
from texgs.scene.series_file import Series, write_series
from texgs.viewer.description import describe

STEPS = ["a.nrrd", "b.nrrd", "c.nrrd"]


@pytest.fixture
def scene_file(tmp_path):
    """A ball that moves to the right by a tenth with each step."""
    models = ball_models(tmp_path, "TF01")
    series = Series(tmp_path / "series.json", STEPS, ["TF01"])
    key = models["TF01"].open()[0]
    for number in range(3):
        moved = key.parameters["means"] + key.parameters["means"].new_tensor([0.1 * number, 0, 0])
        model = replace(key, parameters={**key.parameters, "means": moved})
        write_step(series.model("TF01", number), key, model, {})
    write_series(series)
    return write_scene(tmp_path / "scene.yaml", replace(Scene(models), series=series).at(1))


async def middle(browser):
    """The mean column of what is not white."""
    await browser.send(**{**SHOT, "type": "view", "moving": False})
    picture = (await browser.next("frame"))[1]
    return np.nonzero(picture.min(axis=2) < 250)[1].mean()


@on_page
async def test_a_page_moves_through_time(browser, client):
    await browser.send(type="edit", part="", key="time", value=2, step=1)
    news = await browser.past("time 2")
    assert news["scene"]["time"] == 2
    right = await middle(browser)
    await browser.send(type="edit", part="", key="time", value=0, step=1)
    news = await browser.past("time 0")  # the same step of the history
    assert news["scene"]["time"] == 0
    assert await middle(browser) < right - 3
    await browser.send(type="undo")
    assert (await browser.past())["scene"]["time"] == 1


@on_page
async def test_edits_hold_for_all_steps_and_are_saved_with_the_step(browser, client, scene_file):
    await browser.send(type="edit", part="TF01", key="opacity", value=0.5)
    await browser.send(type="edit", part="", key="time", value=2)
    await browser.past("TF01 opacity 0.5", "time 2")
    await browser.send(type="save", name="scene.yaml", replace=True)
    await browser.next("notice")
    saved = read_scene(scene_file)
    assert saved.time == 2
    assert saved.models["TF01"].edit.opacity == 0.5


def test_names_of_steps_are_known_to_the_page(scene_file):
    scene = read_scene(scene_file)
    told = describe("x", scene, scene.open())
    assert (told["time"], told["steps"]) == (1, STEPS)


@on_page
async def test_steps_that_are_not_there_are_told(browser, client):
    await browser.send(type="edit", part="", key="time", value=3)
    said = (await browser.next("notice"))["text"]
    assert "time: expected the number of a step, 0 to 2, got 3" in said
    await browser.send(type="export", kind="html", view=VIEW, steps="1.5")
    assert "steps: expected all, one or a number N" in (await browser.next("notice"))["text"]
