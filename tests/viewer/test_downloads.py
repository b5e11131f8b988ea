"""Files that a page saves: what is in them, and what cannot be written."""

import io
from dataclasses import dataclass

import numpy as np
import pytest
from PIL import Image, ImageSequence
from plyfile import PlyData

from tests.viewer.pages import TOKEN, on_page
from tests.viewer.test_messages import CAMERA
from texgs.scene import export_keys
from texgs.scene.export_keys import Export
from texgs.scene.film import Film
from texgs.scene.shot import Shot
from texgs.viewer.downloads import exports_of

VIEW = {"camera": CAMERA, "mode": "shaded"}


async def saved(browser, client, kind, **film):
    """Name and bytes of an export."""
    await browser.send(type="export", kind=kind, view=VIEW, **film)
    news = await browser.next("notice")
    assert news["level"] == "file", news
    async with client.get(f"/{TOKEN}/files/{news['name']}") as answer:
        assert answer.status == 200
        return news["name"], await answer.read()


@dataclass(frozen=True)
class Small(Export):
    """Options of an export in seconds."""

    views: int = 12
    size: int = 64
    voxel: float = 0.05
    faces: int = 100
    texture: int = 64


@on_page
async def test_a_film_through_keys_is_that_of_the_command_line(browser, client):
    """At the keys it is the picture of the page, with the edits of the key."""
    place = {"target": [0, 0, 0], "azimuth": 30, "polar": 20, "radius": 3, "fov_y": 40, "seconds": 0.25}
    keys = [place, {**place, "azimuth": 75, "TF01.palette": [0, 0, 1], "light": {"azimuth": 20, "polar": 5}}]
    name, film = await saved(browser, client, "gif", keys=[*keys, {"azimuth": 80}], fps=8)
    assert name == "scene.gif"
    pictures = ImageSequence.Iterator(Image.open(io.BytesIO(film)))
    frames = [np.asarray(each.convert("RGB")).astype(int) for each in pictures]
    assert len(frames) == 5
    shots = Film(keys=keys, fps=8, width=64, height=48).shots(client.server_side.edits.scene)
    for at, (camera, scene) in enumerate(shots):
        expected = client.server_side.edits.session.picture(camera, Shot(), scene).astype(int)
        assert np.abs(frames[at] - expected).mean() < 5, "of the colours of a GIF"
    await browser.send(type="view", id=1, **VIEW)
    _, shown = await browser.next("frame")
    assert np.abs(frames[0] - shown).mean() < 5
    assert np.abs(frames[2] - shown).mean() > 5


@on_page
async def test_a_film_without_keys_is_told(browser, client):
    await browser.send(type="export", kind="mp4", view=VIEW, keys=[{"azimuth": 3}, {"TF03.opacity": 1}])
    assert "keys: key 2: TF03.opacity=1: expected a model" in (await browser.next("notice"))["text"]
    for name in ("TF01.file", "TF01.texture", "TF01/new", "cut"):
        await browser.send(type="export", kind="mp4", view=VIEW, keys=[{}, {name: "/etc/hostname"}])
        assert "keys: no such key" in (await browser.next("notice"))["text"]
    await browser.send(type="export", kind="mp4", view=VIEW)
    assert "keys: expected a list of two keys or more" in (await browser.next("notice"))["text"]


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
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(export_keys, "Export", Small)
        name, binary = await saved(browser, client, "textured")
    assert name == "scene-textured.glb"
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
