"""Files that a page saves: what is in them, and what cannot be written."""

import io

import numpy as np
import torch
from PIL import Image, ImageSequence
from plyfile import PlyData

from tests.viewer.pages import TOKEN, on_page
from tests.viewer.test_messages import CAMERA
from texgs.viewer.downloads import exports_of, way_of
from texgs.viewer.messages import Export, Orbit, View

VIEW = {"camera": CAMERA, "mode": "shaded"}


async def saved(browser, client, kind, **length):
    """Name and bytes of an export."""
    await browser.send(type="export", kind=kind, view=VIEW, **length)
    news = await browser.next("notice")
    assert news["level"] == "file", news
    async with client.get(f"/{TOKEN}/files/{news['name']}") as answer:
        assert answer.status == 200
        return news["name"], await answer.read()


@on_page
async def test_a_turntable_begins_with_the_view(browser, client):
    name, film = await saved(browser, client, "gif", seconds=0.5, fps=8)
    assert name == "scene.gif"
    pictures = ImageSequence.Iterator(Image.open(io.BytesIO(film)))
    frames = [np.asarray(each.convert("RGB")).astype(int) for each in pictures]
    await browser.send(type="view", id=1, **VIEW)
    _, shown = await browser.next("frame")
    assert len(frames) == 4
    assert np.abs(frames[0] - shown).mean() < 5  # of the colours of a GIF
    assert np.abs(frames[2] - shown).mean() > 5


def test_a_film_passes_its_stops_evenly_and_the_short_way():
    places = [(170.0, 0.0, 3.0), (-170.0, 90.0, 6.0), (-100.0, -20.0, 3.0)]
    camera = {"target": (0.0, 0.0, 0.0), "fov_y": 40.0, "width": 8, "height": 4}
    stops = tuple(Orbit(azimuth=a, polar=p, distance=d, **camera) for a, p, d in places)
    way = way_of(Export("mp4", View(stops[0]), stops, seconds=0.5, fps=10))
    for index, stop in zip((0, 2, 4), stops, strict=True):
        torch.testing.assert_close(way[index].camera().viewmat, stop.camera().viewmat, atol=1e-5, rtol=0)
    assert 170 < way[1].azimuth < 190
    assert 0 < way[1].polar < 90
    assert {(each.width, each.height) for each in way} == {(8, 4)}


@on_page
async def test_the_scene_is_written_as_it_is_shown(browser, client):
    _, whole = await saved(browser, client, "3dgs")
    await browser.send(type="edit", part="TF02", key="visible", value=False)
    await browser.past("TF02 visible False")
    _, part = await saved(browser, client, "3dgs")
    counts = [len(PlyData.read(io.BytesIO(each))["vertex"]) for each in (whole, part)]
    assert counts[1] == counts[0] // 2
    name, binary = await saved(browser, client, "gltf")
    assert name == "scene.glb"
    assert binary.startswith(b"glTF")
    name, page = await saved(browser, client, "html")
    assert name == "scene.html"
    assert page.startswith(b"<!doctype html>")


@on_page
async def test_what_a_scene_cannot_be_is_told(browser, client):
    await browser.send(type="export", kind="compact", view=VIEW)
    said = (await browser.next("notice"))["text"]
    able = ", ".join(exports_of(client.server_side.edits.scene))
    assert f"expected one of {able}, got 'compact'" in said
    async with client.get(f"/{TOKEN}/files/scene.html") as answer:
        assert answer.status == 404
