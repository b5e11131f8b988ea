"""New looks on a page: previews, textures that are kept, what is refused, and how one is cancelled."""

import asyncio
import io
import json
import threading
from dataclasses import asdict, replace

import numpy as np
import pytest
import torch
from PIL import Image

from tests.refusals import refused
from tests.viewer.pages import TOKEN, on_page, origin, page
from tests.viewer.test_messages import VIEW
from tests.viewer.test_segments import FRONT, ended
from texgs.core.light import Light
from texgs.core.oklab import chromaticity
from texgs.edit.new_look import learn_look
from texgs.edit.readable import MATERIALS
from texgs.fields.part_edit import PartEdit
from texgs.scene.scene_file import read_scene
from texgs.viewer.looks import Looks
from texgs.viewer.messages import Look
from texgs.viewer.page import Page
from texgs.viewer.styles import Styles

SHOT = {**VIEW, "mode": "shaded", "camera": asdict(FRONT) | {"target": [0, 0, 0]}}


@pytest.fixture(autouse=True)
def quick(monkeypatch, tmp_path_factory):
    """Few and small views and no weights, wherever the tests run."""
    monkeypatch.setattr("texgs.edit.new_look.VIEWS", 12)
    monkeypatch.setattr("texgs.edit.new_look.SIDE", 96)
    monkeypatch.setenv("TEXGS_WEIGHTS", str(tmp_path_factory.mktemp("none")))
    monkeypatch.setenv("TEXGS_CACHE", str(tmp_path_factory.mktemp("cache")))
    monkeypatch.setattr("texgs.viewer.looks.missing_advice", lambda name: "they are missing")


async def picture(browser, **view):
    await browser.send(**{**SHOT, **view, "type": "view", "moving": False})
    return (await browser.next("frame"))[1]


async def still(client, **query):
    async with client.get(f"/{TOKEN}/still.png", params=query) as answer:
        return await answer.read()


def look(**values):
    return {"type": "look", "parts": [], "style": "", "instruction": "", "preview": False, **values}


async def tried(browser, **values):
    """The parts that a preview is on, once it is there."""
    await browser.send(**look(**values, preview=True))
    return (await browser.next("trial"))["parts"]


async def cancelled(browser):
    """The parts that have a preview after a cancellation."""
    await browser.send(type="cancel")
    return (await browser.next("trial"))["parts"]


@on_page
async def test_a_preview_shows_on_its_page_alone_and_changes_nothing(browser, client, scene_file):
    async with page(client) as other:
        await other.next("scene")
        before = await picture(browser)
        assert await tried(browser, style="glass") == ["TF01", "TF02"]
        assert np.abs(await picture(browser) - before).mean() > 3
        assert (await picture(browser, before=True) == before).all()
        assert (await picture(other) == before).all()
        query = {"view": json.dumps({"camera": SHOT["camera"], "mode": "shaded"})}
        stills = [await still(client, **query, page=number) for number in ("1", "2", "none")]
        assert stills[0] != stills[1] == stills[2], "the other page and strangers see what all share"
        assert client.server_side.edits.state()["past"] == []
        assert await cancelled(browser) == []
        assert (await picture(browser) == before).all()
    assert not [path for path in scene_file.parent.iterdir() if path.is_dir()]


@on_page
async def test_a_look_is_one_step_and_written_beside_the_scene(browser, scene_file):
    before = await picture(browser)
    gold = {"parts": ["TF01"], "instruction": "turn it into gold"}
    await tried(browser, **gold)
    preview = await picture(browser)
    await browser.send(**look(**gold))
    news = await browser.next("notice")
    assert news["level"] == "info"
    assert "turn it into gold: procedural filters" in news["text"]
    await browser.past("TF01 turn it into gold")
    after = await picture(browser)
    assert np.abs(after - before).mean() > 1
    assert (after == preview).all(), "the preview has the highlights of gold, too"
    await browser.send(type="save", name="gold.yaml")
    await browser.next("notice")
    await browser.send(type="undo")
    assert (await picture(browser) == before).all()
    await browser.send(type="redo")
    assert (await picture(browser) == after).all()
    models = read_scene(scene_file.parent / "gold.yaml").models
    assert models["TF01"].texture.parent.name == "scene-text-1"
    assert models["TF01"].edit.tint == MATERIALS["gold"].tint
    assert models["TF01"].edit.specular != 1
    assert models["TF02"].edit == PartEdit()
    assert models["TF02"].texture is None


@on_page
async def test_words_are_tried_from_one_side_and_change_nothing(browser, client):
    before = await picture(browser)
    await tried(browser, instruction="turn it into gold", camera=SHOT["camera"])
    preview = await picture(browser)
    assert client.server_side.edits.state()["past"] == []
    await browser.send(**look(instruction="turn it into gold"))
    await ended(browser)
    made = await picture(browser)
    assert np.abs(preview - made).mean() < 0.5 * np.abs(made - before).mean(), "from this side it is alike"


def test_previews_of_words_are_made_by_filters_all_else_by_a_network_that_is_there(monkeypatch, tmp_path):
    monkeypatch.setattr("texgs.viewer.looks.missing_advice", lambda name: None)
    looks = Looks(Styles(tmp_path), tmp_path)
    full, tried, side = (
        looks.recipe_of(Look(instruction="gold", preview=preview, camera=camera))
        for preview, camera in ((False, FRONT), (True, None), (True, FRONT))
    )
    assert (full.guidance, full.recipe, full.size) == ("instruct_pix2pix", "default", 512)
    assert (tried.guidance, tried.recipe, tried.recipe_of().views) == ("filters", "quick", "axes")
    assert (side.guidance, side.recipe_of().views) == ("filters", "all")


@pytest.mark.parametrize("preview", [True, False])
@pytest.mark.parametrize("follows", [{"style": "glass"}, {"instruction": "gold"}])
def test_the_hue_of_a_look_is_that_of_the_message(tmp_path, follows, preview):
    looks = Looks(Styles(tmp_path), tmp_path)
    hues = [
        looks.recipe_of(Look(**follows, **more, preview=preview)).hue
        for more in ({}, {"hue": 0.3}, {"hue": 0})
    ]
    assert hues == [1, 0.3, 0]


@pytest.mark.parametrize("follows", [{"style": "glass"}, {"instruction": "turn it into gold"}])
@on_page
async def test_a_preview_may_keep_the_hues_of_the_functions(browser, follows):
    def hue(pixels):
        return chromaticity(torch.from_numpy(pixels / 255))

    before = hue(await picture(browser))
    off = []
    for share in (1, 0):
        assert await tried(browser, **follows, hue=share) == ["TF01", "TF02"]
        off.append((hue(await picture(browser)) - before).norm(dim=-1).mean())
    assert off[1] < 0.8 * off[0], "the rest is the mixture of layers, which a look makes more opaque"


@on_page
async def test_textures_on_their_way_are_shown_as_opaque_as_they_become(browser, client, monkeypatch):
    """Also those of a faint part, which the look makes more opaque."""
    monkeypatch.setattr("texgs.viewer.looks.SECONDS_BETWEEN", 0.0)
    edits, shown, try_on = client.server_side.edits, [], Page.try_on
    monkeypatch.setattr(Page, "try_on", lambda own, looks: shown.append(looks) or try_on(own, looks))
    await browser.send(type="edit", part="TF02", key="opacity", value=0.1)
    await browser.past("TF02 opacity 0.1")
    await browser.send(**look(parts=["TF02"], style="dots"))
    assert (await browser.next("trial"))["parts"] == ["TF02"]
    await ended(browser)
    assert edits.state()["past"] == ["TF02 opacity 0.1", "TF02 dots"]
    *on_their_way, last = shown
    assert last is None
    opacity = edits.scene.models["TF02"].edit.opacity
    assert opacity > 0.1
    assert {each["TF02"].edit["opacity"] for each in on_their_way} == {opacity}


@on_page
async def test_a_picture_of_the_user_is_taken_in(browser, client, tmp_path):
    pixels = np.random.default_rng(0).integers(0, 255, (64, 64, 3), dtype=np.uint8)
    Image.fromarray(pixels).save(tmp_path / "noise.png")
    path, headers = f"/{TOKEN}/styles", origin(client)
    content = (tmp_path / "noise.png").read_bytes()
    async with client.post(path, params={"name": "noise.png"}, data=content, headers=headers) as answer:
        name = await answer.text()
    assert name == "1 noise.png"
    assert await tried(browser, style=name) == ["TF01", "TF02"]
    for bad, message in (("../x.png", "expected a name that a file can have"), ("x.png", "x.png: ")):
        async with client.post(path, params={"name": bad}, data=b"no", headers=headers) as answer:
            assert answer.status == 400
            text = await answer.text()
            assert message in text
            assert str(tmp_path) not in text
    async with client.post(path, params={"name": "a.png"}, data=content) as answer:
        assert answer.status == 403
    async with client.post(path, data=bytes(33 * 2**20), headers=headers) as answer:
        assert answer.status == 413


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"style": "dots", "instruction": "gold"}, "look: expected a picture or an instruction"),
        ({"style": "/etc/passwd"}, "style: expected one of strokes"),
        ({"instruction": "${oc.env:HOME}"}, "'${oc.env:HOME}': expected what filters know"),  # no reference
        ({"instruction": "a cathedral", "preview": True}, "'a cathedral': expected what filters know"),
        ({"style": "dots", "parts": ["TF09"]}, "edit.parts: expected some of TF01, TF02, got TF09"),
    ],
)
@on_page
async def test_what_cannot_be_is_told_before_a_job_begins(browser, values, message):
    await browser.send(**look(**values))
    assert message in (await browser.next("notice"))["text"]


@on_page
async def test_a_look_is_cancelled_and_leaves_nothing(browser, scene_file, monkeypatch):
    reached, go_on = threading.Event(), threading.Event()

    def wait(*_):
        reached.set()
        go_on.wait(30)

    monkeypatch.setattr("texgs.viewer.looks.Throttled.__call__", wait)
    await browser.send(**look(parts=["TF01"], style="dots"))
    await asyncio.to_thread(reached.wait, 30)
    await browser.send(type="edit", part="TF01", key="opacity", value=0.5)
    await browser.past("TF01 opacity 0.5")  # edits go on meanwhile
    await browser.send(type="cancel")
    await browser.next("trial")
    go_on.set()
    assert "it was cancelled" in (await browser.next("notice"))["text"]
    await ended(browser)
    assert not [path for path in scene_file.parent.iterdir() if path.is_dir()]


@pytest.fixture
def held(monkeypatch):
    """Previews wait at their end for the second event, and set the first when they are there."""
    reached, go_on, tried = threading.Event(), threading.Event(), Looks.tried

    def slow(*words):
        result = tried(*words)
        reached.set()
        go_on.wait(30)
        return result

    monkeypatch.setattr(Looks, "tried", slow)
    return reached, go_on


@on_page
async def test_a_preview_that_is_cancelled_as_it_ends_is_not_shown(browser, held):
    reached, go_on = held
    before = await picture(browser)
    await browser.send(**look(style="glass", preview=True))
    await asyncio.to_thread(reached.wait, 30)
    assert await cancelled(browser) == []
    go_on.set()
    assert await tried(browser, parts=["TF01"], style="dots") == ["TF01"], "nothing of the first"
    assert await cancelled(browser) == []
    assert (await picture(browser) == before).all()


@on_page
async def test_of_previews_that_wait_the_newest_is_shown(browser, client, held):
    reached, go_on = held
    await browser.send(**look(style="glass", preview=True))
    await asyncio.to_thread(reached.wait, 30)
    for style in ("marble", "weave", "dots"):
        await browser.send(**look(style=style, preview=True))
    await picture(browser)  # frames go on meanwhile
    go_on.set()
    await browser.next("trial")
    newest = await picture(browser)
    (own,) = client.server_side._pages
    (folder,) = {each.texture.parent for each in own._trial.values()}
    assert len([*folder.parent.iterdir()]) == 2, "those between were not made"
    await tried(browser, style="dots")
    assert (await picture(browser) == newest).all()


@on_page
async def test_a_preview_is_on_the_parts_that_are_chosen_and_on_no_others(browser, client):
    (own,) = client.server_side._pages
    for parts in ([], ["TF02"], ["TF01"]):
        assert await tried(browser, parts=parts, style="glass") == (parts or ["TF01", "TF02"])
        assert all(look.texture.is_file() for look in own._trial.values())


async def thumbnail(client, style="glass", **values):
    asked = json.dumps({**look(style=style, preview=True), "camera": SHOT["camera"], **values})
    async with client.get(f"/{TOKEN}/thumbnail.jpg", params={"look": asked}) as answer:
        return answer.status, await answer.read()


@on_page
async def test_a_thumbnail_is_the_scene_with_a_picture_on_it(browser, client):
    """It is the preview, as the page shows it, in small."""
    await tried(browser, style="glass")
    shown = Image.fromarray((await picture(browser)).astype(np.uint8))
    status, content = await thumbnail(client)
    small = Image.open(io.BytesIO(content))
    assert (status, small.format, small.height) == (200, "JPEG", 112)
    off = np.abs(np.asarray(small).astype(int) - np.asarray(shown.resize(small.size)).astype(int)).mean()
    _, other = await thumbnail(client, "dots")
    others = np.abs(
        np.asarray(Image.open(io.BytesIO(other))).astype(int) - np.asarray(small).astype(int)
    ).mean()
    assert off < 0.5 * others


def test_a_thumbnail_leaves_shadows_out(scene_file, tmp_path):
    """Its scene needs no volume; the look itself is the same."""
    scene, asked = read_scene(scene_file), Look(style="glass", camera=FRONT)
    dark = replace(scene, light=Light("directional", 30, 40, shadows=0.8, occlusion=0.5))
    lit = replace(scene, light=dark.light.unhidden)
    looks = Looks(Styles(tmp_path), tmp_path / "looks")
    assert looks.thumbnail(dark, asked) == looks.thumbnail(lit, asked)


@on_page
async def test_thumbnails_and_the_preview_of_a_picture_are_learned_once(browser, client, monkeypatch):
    """For all cameras, until the scene is another; what a page shows stays meanwhile."""
    learned = []
    monkeypatch.setattr(
        "texgs.viewer.looks.learn_look", lambda task: learned.append(task) or learn_look(task)
    )
    _, first = await thumbnail(client)
    _, turned = await thumbnail(client, camera=SHOT["camera"] | {"azimuth": 0})
    await tried(browser, style="glass")
    shown = await picture(browser)
    assert (first != turned, len(learned)) == (True, 1)
    await browser.send(type="edit", part="TF01", key="visible", value=False)
    await browser.past("TF01 visible False")
    assert (await thumbnail(client))[1] != first
    assert len(learned) == 2
    await browser.send(type="undo")
    await browser.past()
    assert (await picture(browser) == shown).all()


@on_page
async def test_a_thumbnail_that_cannot_be_is_a_sentence(client, browser):
    for values, message in (
        ({"style": "nothing"}, b"style: expected one of strokes"),
        ({"camera": None}, b"camera: expected one to show a thumbnail from, got none"),
        ({"colour": 1}, b"colour: no such key"),
    ):
        status, text = await thumbnail(client, **values)
        assert (status, text[: len(message)]) == (400, message)


def test_pictures_of_a_folder(tmp_path):
    refused(lambda: Styles(tmp_path, tmp_path / "none"), "--styles: expected a folder")
    refused(lambda: Styles(tmp_path, tmp_path), "got 0")
    Image.new("RGB", (64, 48), "red").save(tmp_path / "red.png")
    (tmp_path / "broken.JPG").write_bytes(b"no picture")
    (tmp_path / "notes.txt").write_text("not offered")
    Image.new("1", (13_000, 13_000)).save(tmp_path / "large.png")
    styles = Styles(tmp_path, tmp_path)
    assert styles.names[-3:] == ["broken.JPG", "large.png", "red.png"]
    assert styles.source("red.png") == str(tmp_path / "red.png")
    refused(lambda: styles.source("large.png"), "large.png: expected a picture of at most 50 million pixels")
    for number in range(51):
        (tmp_path / f"{number}.png").touch()
    refused(lambda: Styles(tmp_path, tmp_path), "got 54")
