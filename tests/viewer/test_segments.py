"""Segments from clicks on a page: their masks, their surfels, their history, and how they are stopped."""

import asyncio
import base64
import io
import threading
from dataclasses import asdict

import numpy as np
import pytest
import torch
from PIL import Image

from tests.edit.lift_scenes import two_balls
from tests.viewer.pages import on_page
from texgs.edit.clicks import Clicks
from texgs.edit.lift import lift
from texgs.edit.mask_keys import MaskKeys
from texgs.fields.part_edit import PartEdit
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.model_file import write_model
from texgs.models.masks import GrabCut
from texgs.scene.scene import Scene, SceneModel
from texgs.scene.scene_file import read_scene
from texgs.scene.segment_file import read_segment
from texgs.viewer.messages import Orbit
from texgs.viewer.segments import isolated
from texgs.volume.cameras import icosphere_of

FRONT = Orbit((0.0, 0.0, 0.0), -90, 0, 4.0, 22.0, 120, 120)  # on +z
KEYS = MaskKeys(views=12)
RED, BESIDE = (-0.3, 0.0, 0.0), (0.0, -0.7, 0.0)


@pytest.fixture(autouse=True)
def small(monkeypatch):
    """Few views and no weights, wherever the tests run."""
    monkeypatch.setattr("texgs.viewer.segments.CHOICES", ("grabcut",))
    monkeypatch.setattr("texgs.viewer.segments.VOTING", KEYS)


@pytest.fixture
def scene_file(balls_file):
    return balls_file


def at(place):
    """Pixel of a place."""
    return FRONT.camera().project(torch.tensor(place))[0].tolist()


def clicked(*points):
    points = [[*at(place), is_on] for place, is_on in points]
    return {"camera": asdict(FRONT) | {"target": [0, 0, 0]}, "points": points}


def outlined(*places):
    return {"camera": asdict(FRONT) | {"target": [0, 0, 0]}, "points": [], "outline": [at(x) for x in places]}


BOX = [(-0.6, -0.35, 0.0), (0.0, -0.35, 0.0), (0.0, 0.35, 0.0), (-0.6, 0.35, 0.0)]


async def ended(browser):
    """The notices of a job, until it has ended."""
    while (await browser.next("job"))["done"] is not None:
        pass


async def masked(browser, asked=None):
    """What a click selects [H, W], by default."""
    await browser.send(type="mask", id=3, model="balls", **(asked or clicked((RED, True))))
    message = await browser.next("mask")
    assert (message["id"], message["by"]) == (3, "GrabCut")
    png = base64.b64decode(message["picture"].removeprefix("data:image/png;base64,"))
    return np.asarray(Image.open(io.BytesIO(png)))[..., 3] > 0


@on_page
async def test_clicks_show_their_mask(browser):
    mask = await masked(browser)
    rows, columns = mask.nonzero()
    assert mask.shape == (120, 120)
    middle, (x, y) = (columns.mean(), rows.mean()), at(RED)
    assert abs(middle[0] - x) < 2
    assert abs(middle[1] - y) < 2
    radius = 0.25 * 120 / (2 * 4 * np.tan(np.radians(11)))  # pixels
    assert mask.sum() == pytest.approx(np.pi * radius**2, rel=0.15)  # its surfels reach beyond its outline


@on_page
async def test_an_outline_shows_the_mask_of_what_it_holds_and_makes_a_segment(browser, scene_file):
    assert (await masked(browser, outlined(*BOX)) == await masked(browser)).mean() > 0.995
    assert (await masked(browser, outlined(*BOX[:3]))).sum() < (await masked(browser)).sum()
    await browser.send(type="segment", part="balls/red", **outlined(*BOX))
    await ended(browser)
    (file,) = scene_file.parent.glob("scene-balls-red*")
    model, red = two_balls()
    mask = read_segment(file, model)
    assert (mask == (red == 0)).float().mean() > 0.97


@on_page
async def test_clicks_see_a_model_that_was_written_again(browser, scene_file):
    before = await masked(browser)
    model = two_balls()[0]
    smaller = {**model.parameters, "means": model.parameters["means"] * 0.9}
    write_model(scene_file.with_name("balls.safetensors"), Surfels(smaller, model.shading))
    assert (await masked(browser)).sum() != before.sum()


@on_page
async def test_clicks_make_a_segment_that_is_edited_renamed_removed_undone_and_saved(browser, scene_file):
    await browser.send(type="segment", part="balls/red", **clicked((RED, True)))
    await ended(browser)
    await browser.send(type="edit", part="balls/red", key="opacity", value=0.5)
    await browser.past("balls/red new", "balls/red opacity 0.5")
    await browser.send(type="save", name="scene.yaml")
    await browser.next("notice")
    await browser.send(type="undo")
    await browser.send(type="rename", part="balls", name="x")
    assert "expected a segment to rename, got the model balls" in (await browser.next("notice"))["text"]
    await browser.send(type="rename", part="balls/red", name="sea")
    news = await browser.past("balls/red new", "balls/red renamed to sea")
    assert [each["name"] for each in news["scene"]["models"][0]["segments"]] == ["sea"]
    await browser.send(type="undo")
    await browser.send(type="remove", part="balls/red")
    news = await browser.past("balls/red new", "balls/red removed")
    assert news["scene"]["models"][0]["segments"] == []
    await browser.send(type="undo")
    (segment,) = (await browser.next("scene"))["scene"]["models"][0]["segments"]
    assert segment["name"] == "red"
    saved = read_scene(scene_file).models["balls"]
    assert saved.segments["red"].edit == PartEdit(opacity=0.5)
    model, red = two_balls()
    mask = read_segment(saved.segments["red"].file, model)
    clicks = Clicks(FRONT.camera(), torch.tensor([at(RED)]), torch.tensor([True]))
    cameras = icosphere_of(KEYS.views, read_scene(scene_file).framed().lens().square(KEYS.size))
    assert mask.equal(lift(model, clicks, cameras, GrabCut()).mask)
    assert bool(mask[red == 0].all())


@on_page
async def test_a_segment_replaces_no_file(browser, scene_file):
    (taken := scene_file.parent / "scene-balls-red.safetensors").write_bytes(b"mine")
    await browser.send(type="segment", part="balls/red", **clicked((RED, True)))
    await ended(browser)
    assert taken.read_bytes() == b"mine"
    assert (scene_file.parent / "scene-balls-red-2.safetensors").exists()


@pytest.mark.parametrize(
    ("part", "points", "message"),
    [
        ("balls/a.b", [(RED, True)], "segment: expected a name without"),
        ("other/red", [(RED, True)], "expected a model of the scene (balls), got other"),
        ("balls/red", [(BESIDE, True)], "expected a place on the model, got background"),
        ("balls/red", [], "points: expected a positive one at least, got none"),
    ],
)
@on_page
async def test_clicks_that_select_nothing_are_told(browser, part, points, message):
    await browser.send(type="segment", part=part, **clicked(*points))
    assert message in (await browser.next("notice"))["text"]
    assert (await browser.next("scene"))["past"] == []


class Waiting(GrabCut):
    """Waits at its second view until it may go on."""

    def __init__(self):
        self.reached, self.go_on, self.calls = threading.Event(), threading.Event(), 0

    def __call__(self, image, points, positive, held=None, shown=None):
        self.calls += 1
        if self.calls == 2:
            self.reached.set()
            self.go_on.wait(30)
        return super().__call__(image, points, positive, held, shown)


@on_page
async def test_a_segment_is_cancelled_and_only_one_is_made_at_a_time(browser, scene_file, monkeypatch):
    masks = Waiting()
    monkeypatch.setattr("texgs.viewer.segments.mask_model", lambda name, device: masks)
    await browser.send(type="segment", part="balls/red", **clicked((RED, True)))
    await asyncio.to_thread(masks.reached.wait, 30)
    await browser.send(type="segment", part="balls/other", **clicked((RED, True)))
    assert "a job is at work already" in (await browser.next("notice"))["text"]
    await browser.send(type="edit", part="balls", key="opacity", value=0.5)
    await browser.past("balls opacity 0.5")  # edits go on meanwhile
    await browser.send(type="cancel")
    await browser.send(type="undo")
    await browser.past()  # the server has read what came before
    masks.go_on.set()
    assert "it was cancelled" in (await browser.next("notice"))["text"]
    await ended(browser)
    assert masks.calls == 2
    assert not list(scene_file.parent.glob("scene-*"))


def test_a_model_alone_has_no_edits(scene_file):
    scene = read_scene(scene_file)
    models = {**scene.models, "other": SceneModel(scene.models["balls"].file, PartEdit(opacity=0.2))}
    shown = isolated(Scene(models), "other")
    assert shown.models["other"].edit == PartEdit()
    assert not shown.models["balls"].edit.visible
