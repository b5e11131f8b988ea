"""The viewer of a scene that Python holds: edits on pages reach Python, and the other way round."""

import asyncio
import threading
from pathlib import Path
from urllib.parse import urlsplit

import aiohttp
import pytest

import texgs
from tests.scene.balls import write_balls
from tests.viewer.pages import Browser
from texgs.core.light import Light
from texgs.scene.scene_file import read_scene
from texgs.scene.session import Session
from texgs.viewer.messages import Edit
from texgs.viewer.shared_edits import SharedEdits, open_scene

MEANWHILE = 0.5  # seconds that a step of one thread takes, in which the other one edits if nothing stops it
DRAGGED, LIT = "TF01 opacity 0.25", "light (30, 40)"


async def talk(address, scene):
    parts = urlsplit(address)
    headers = {"Origin": f"{parts.scheme}://{parts.netloc}"}
    async with aiohttp.ClientSession() as client:
        async with client.get(address) as answer:
            assert answer.status == 200
            assert "frame-ancestors" not in answer.headers["Content-Security-Policy"]
        async with client.get(address[:-5] + "/") as answer:
            assert answer.status == 403
        async with client.ws_connect(address + "socket", headers=headers) as socket:
            page = Browser(socket)
            opened = await page.next("scene")
            assert opened["title"] == "TF01, TF02"
            edit = {"part": "TF01", "key": "opacity", "value": 0.25, "step": 1}
            await page.send(type="edit", **edit)
            await page.past("TF01 opacity 0.25")
            assert scene["TF01"].opacity == 0.25
            scene["TF02"].visible = False
            news = await page.past("TF01 opacity 0.25", "TF02 visible False")
            assert [model["edit"]["visible"] for model in news["scene"]["models"]] == [True, False]


def test_pages_and_python_edit_the_same_scene(tmp_path):
    scene = texgs.open(write_balls(tmp_path))
    shown = scene.show(live=True)
    assert shown._repr_html_().startswith(f'<iframe src="{shown.address}"')
    asyncio.run(talk(shown.address, scene))
    assert scene.undo()
    assert scene["TF02"].visible
    assert scene.show(live=True).address == shown.address


def test_what_a_page_saves_outlives_the_process(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scene = texgs.open(write_balls(tmp_path / "balls"))
    scene.show(live=True)
    edits = scene._viewer._server.edits
    assert edits.save("mine.yaml") == Path("mine/scene.yaml").absolute()
    assert edits.would_replace("mine.yaml") is False
    assert {model.file.parent for model in read_scene("mine").models.values()} == {Path("mine")}


def by_session(scene):
    scene.session.set_light(Light("directional", 30, 40))


def by_property(scene):
    scene.light = (30, 40)


@pytest.mark.parametrize(
    ("step", "is_page_first", "light", "past"),
    [
        ("_push", True, by_property, [DRAGGED, LIT]),
        ("_push", False, by_property, ["TF01 opacity 0.5", LIT, DRAGGED]),
        ("undo", True, by_property, [DRAGGED, LIT]),
        ("undo", True, by_session, [DRAGGED, ""]),
        ("_push", False, by_session, ["TF01 opacity 0.5", "", DRAGGED]),
    ],
)
def test_neither_thread_loses_what_the_other_edits_meanwhile(
    tmp_path, monkeypatch, step, is_page_first, light, past
):
    """A page drags a number, each time by an undo and a change, while Python sets the light."""
    file = write_balls(tmp_path)
    scene = texgs.open(file)
    edits, made = SharedEdits(scene.session, open_scene(file)), getattr(Session, step)

    def drag(value):
        edits.change(Edit("TF01", "opacity", value, step=1, title=f"TF01 opacity {value}"), author=1)

    def by_page():
        drag(0.25)

    def by_python():
        light(scene)

    drag(0.5)
    first, second = (by_page, by_python) if is_page_first else (by_python, by_page)
    other = threading.Thread(target=second)

    def slow(session, *given):
        monkeypatch.undo()
        other.start()
        other.join(MEANWHILE)
        return made(session, *given)

    monkeypatch.setattr(Session, step, slow)
    first()
    other.join()
    assert scene["TF01"].opacity == 0.25
    assert scene.light == Light("directional", 30, 40)
    assert scene.session.past == past
