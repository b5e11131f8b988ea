"""Files that a page saves: what is in them, and what cannot be written."""

import io

import numpy as np
import pytest
from PIL import Image, ImageSequence
from plyfile import PlyData

from tests.viewer.test_messages import CAMERA
from tests.viewer.test_server import TOKEN, with_page

VIEW = {"camera": CAMERA, "mode": "shaded"}


async def saved(browser, client, kind):
    """Name and bytes of an export."""
    await browser.send(type="export", kind=kind, view=VIEW)
    news = await browser.next("notice")
    assert news["level"] == "file", news
    async with client.get(f"/{TOKEN}/files/{news['name']}") as answer:
        assert answer.status == 200
        return news["name"], await answer.read()


def test_a_turntable_begins_with_the_view(scene_file, monkeypatch):
    monkeypatch.setattr("texgs.viewer.downloads.FRAMES", 4)

    async def work(browser, client):
        name, film = await saved(browser, client, "gif")
        assert name == "scene.gif"
        frames = [
            np.asarray(each.convert("RGB")).astype(int)
            for each in ImageSequence.Iterator(Image.open(io.BytesIO(film)))
        ]
        await browser.send(type="view", id=1, **VIEW)
        _, shown = await browser.next("frame")
        assert len(frames) == 4
        assert np.abs(frames[0] - shown).mean() < 5  # of the colours of a GIF
        assert np.abs(frames[2] - shown).mean() > 5

    with_page(scene_file, work)


def test_the_scene_is_written_as_it_is_shown(scene_file):
    async def work(browser, client):
        _, whole = await saved(browser, client, "3dgs")
        await browser.send(type="edit", part="TF02", key="visible", value=False)
        while not (await browser.next("scene"))["past"]:
            pass
        _, part = await saved(browser, client, "3dgs")
        counts = [len(PlyData.read(io.BytesIO(each))["vertex"]) for each in (whole, part)]
        assert counts[1] == counts[0] // 2
        name, page = await saved(browser, client, "html")
        assert name == "scene.html"
        assert page.startswith(b"<!doctype html>")

    with_page(scene_file, work)


@pytest.mark.parametrize("kind", ["compact", "nothing"])
def test_what_a_scene_cannot_be_is_told(scene_file, kind):
    async def work(browser, client):
        await browser.send(type="export", kind=kind, view=VIEW)
        assert (
            f"expected one of mp4, gif, 3dgs, 2dgs, points, mesh, html, got '{kind}'"
            in (await browser.next("notice"))["text"]
        )
        async with client.get(f"/{TOKEN}/files/scene.html") as answer:
            assert answer.status == 404

    with_page(scene_file, work)
