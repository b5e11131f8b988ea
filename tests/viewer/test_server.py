"""The viewer's server: who may talk to it, what it answers, what pages share."""

import asyncio
import io
import json
from dataclasses import replace
from shutil import copy

import numpy as np
import pytest
import torch
from aiohttp import WSCloseCode, WSMsgType
from PIL import Image

from tests.viewer.pages import TOKEN, WAIT, on_page, page, served
from tests.viewer.test_messages import CAMERA, SHOWN, VIEW
from texgs.cli.main import main
from texgs.core.cuts import NO_CUTS
from texgs.core.io import write_json
from texgs.report.check import checksum_of
from texgs.scene.parts import replace_entry
from texgs.scene.scene import MAX_FUNCTIONS
from texgs.scene.scene_file import read_scene, write_scene
from texgs.viewer import guard
from texgs.viewer.messages import parse
from texgs.viewer.segments import isolated

# ---- Who may talk to it -----------------------------------------------------

SOCKET = {"Connection": "Upgrade", "Upgrade": "websocket"}


@pytest.mark.parametrize(
    ("path", "headers"),
    [
        ("/", {}),
        ("/x/", {}),
        ("/ü/", {}),
        (f"/{TOKEN[:-1]}/", {}),
        (f"/{TOKEN}/", {"Host": "evil.example"}),
        (f"/{TOKEN}/", {"Host": "127.0.0.1.evil.example:80"}),
        (f"/{TOKEN}/", {"Host": "["}),
        (f"/{TOKEN}/still.png", {"Origin": "http://evil.example"}),
        (f"/{TOKEN}/still.png", {"Origin": "null"}),
        (f"/{TOKEN}/still.png", {"Origin": "http://["}),
        (f"/{TOKEN}/../x", {}),
        (f"/{TOKEN}/socket", SOCKET),  # browsers name the origin of a socket
        (f"/{TOKEN}/socket", {**SOCKET, "Origin": "http://evil.example"}),
        (f"/{TOKEN}/socket", {**SOCKET, "Host": "evil.example", "Origin": "http://evil.example"}),
        ("/wrong/socket", SOCKET),
    ],
)
@on_page
async def test_strangers_get_403(client, path, headers):
    async with client.get(path, headers=headers) as answer:
        assert answer.status == 403
        assert "open the address that texgs view printed" in await answer.text()
        assert answer.headers["X-Content-Type-Options"] == "nosniff"
        assert answer.headers["Content-Security-Policy"] == "default-src 'none'"


@pytest.mark.parametrize(
    ("name", "host", "is_own"),
    [
        ("localhost:1", "127.0.0.1", True),
        ("[::1]:80", "127.0.0.1", True),
        ("192.168.1.5:80", "127.0.0.1", False),
        ("192.168.1.5:80", "0.0.0.0", True),
        ("evil.example", "0.0.0.0", False),
        ("box.lab:80", "box.lab", True),
        ("", "0.0.0.0", False),
        ("localhost:80 evil.example", "127.0.0.1", False),
    ],
)
def test_hosts(name, host, is_own):
    assert guard.is_own_host(name, host, (host,)) is is_own


@on_page
async def test_pages_are_served_with_a_strict_policy_and_nothing_else(client):
    async with client.get(f"/{TOKEN}/") as answer:
        assert answer.status == 200
        assert "default-src 'none'" in answer.headers["Content-Security-Policy"]
        assert answer.headers["Referrer-Policy"] == "no-referrer"
    for name in ("page.html", "server.py", "..%2Fserver.py", "%2e%2e%2fserver.py", "x.js"):
        async with client.get(f"/{TOKEN}/{name}") as answer:
            assert answer.status in (403, 404), name
            assert "default-src 'none'" in answer.headers["Content-Security-Policy"]


# ---- Frames -----------------------------------------------------------------


async def still(client, query):
    """Status, bytes and headers of a picture that is asked for."""
    async with client.get(f"/{TOKEN}/still.png", params={"view": query}) as answer:
        return answer.status, await answer.read(), answer.headers


@on_page
async def test_frames_are_those_of_the_renderer(browser, client, scene_file, tmp_path):
    words = ["--width", "64", "--height", "48", "--target", "0", "0", "0", "--radius", "3", "--fov", "40"]
    words += ["--mode", "normal", "--output", str(tmp_path / "a.png")]
    assert main(["render", str(scene_file), *words]) == 0
    expected = np.asarray(Image.open(tmp_path / "a.png")).astype(int)
    await browser.send(**{**VIEW, "moving": False})
    header, shown = await browser.next("frame")
    assert header["id"] == 7
    assert np.abs(shown - expected).mean() < 2  # of JPEG at quality 95
    _, png, _ = await still(client, json.dumps({"camera": CAMERA, "mode": "normal"}))
    assert png == (tmp_path / "a.png").read_bytes()


@on_page
async def test_a_still_has_what_a_check_has_found_or_says_what_is_wrong(browser, client, scene_file):
    scene, file = client.server_side.edits.scene, scene_file.with_name(f"{scene_file.stem}-check.json")
    for models, told in ((checksum_of(scene), "At least 30 dB"), ("others", None)):
        write_json(file, {"models": models, "sentence": "At least 30 dB"})
        _, png, _ = await still(client, json.dumps({"camera": CAMERA}))
        assert Image.open(io.BytesIO(png)).info.get("Comment") == told
    for query, message in (("", b"JSON"), ("[]", b"expected keys with values"), ("{}", b"camera")):
        status, text, _ = await still(client, query)
        assert status == 400
        assert message in text


@on_page
async def test_a_pixel_of_a_view_is_a_point_or_nothing(browser):
    await browser.send(type="pick", view=SHOWN, pixel=[32, 24])
    point = torch.tensor((await browser.next("point"))["point"])
    place, _ = parse(json.dumps(VIEW)).camera.camera().project(point)
    torch.testing.assert_close(place, torch.tensor([32.5, 24.5]), atol=1e-3, rtol=0)
    await browser.send(type="pick", view=SHOWN, pixel=[0, 0])
    assert (await browser.next("point"))["point"] is None


@on_page
async def test_the_newest_camera_wins(browser, client):
    for number in range(200):
        await browser.send(**{**VIEW, "id": number})
    shown = []
    while not shown or shown[-1] != 199:
        shown.append((await browser.next("frame"))[0]["id"])
    assert shown == sorted(shown)
    assert len(shown) < 100, "most cameras were old when their turn came"


@on_page
async def test_frames_of_a_moving_camera_are_smaller_where_they_are_slow(browser, client, monkeypatch):
    sizes = []
    for slow, moving in ((1e-9, False), (1e-9, True), (1e-9, False), (1e9, True), (1e9, True)):
        monkeypatch.setattr("texgs.viewer.frames.SLOW_FRAME", slow)
        await browser.send(**{**VIEW, "moving": moving})
        sizes.append((await browser.next("frame"))[1].shape[:2])
    assert sizes == [(48, 64), (16, 21), (48, 64), (16, 21), (48, 64)]


@on_page
async def test_an_error_of_a_frame_is_a_notice(browser, client, scene_file):
    (model := scene_file.parent / "TF01.safetensors").rename(scene_file.parent / "away")
    await browser.send(**VIEW)
    notice = await browser.next("notice")
    assert notice["level"] == "error"
    assert notice["frame"] == 7
    assert str(model) in notice["text"]
    (scene_file.parent / "away").rename(model)
    await browser.send(**VIEW)
    assert (await browser.next("frame"))[0]["id"] == 7


# ---- Edits ------------------------------------------------------------------


async def saved(browser, name, **values):
    """The notice of what is saved."""
    await browser.send(type="save", name=name, **values)
    return await browser.next("notice")


@on_page
async def test_pages_share_edits_and_their_history(browser, client):
    async with page(client) as other:
        assert (await other.next("scene"))["saved"]
        await browser.send(type="edit", part="TF01", key="palette", value="#ff0000")
        for each in (browser, other):
            news = await each.next("scene")
            assert news["scene"]["models"][0]["edit"]["palette"] == [1, 0, 0]
            assert news["past"] == ["TF01 palette #ff0000"]
            assert not news["saved"]
        await other.send(type="undo")
        news = await browser.next("scene")
        assert news["scene"]["models"][0]["edit"]["palette"] is None
        assert (news["past"], news["future"]) == ([], ["TF01 palette #ff0000"])
        assert news["saved"]
        await browser.send(type="edit", part="", key="light", value={"azimuth": 30, "polar": 40})
        await other.send(type="redo")
        await other.send(type="edit", part="", key="background", value=None)
        news = await browser.past("light {'azimuth': 30, 'polar': 40}", "background None")
        assert news["scene"]["light"] == {"azimuth": 30, "polar": 40}


@on_page
async def test_reach_is_an_edit_of_the_scene_that_stays_with_its_light(browser):
    await browser.send(type="edit", part="", key="reach", value=0.5)
    await browser.send(type="edit", part="", key="light", value={"azimuth": 30, "polar": 40})
    news = await browser.past("reach 0.5", "light {'azimuth': 30, 'polar': 40}")
    assert news["scene"]["reach"] == 0.5
    await browser.send(type="edit", part="", key="reach")
    assert (await browser.next("scene"))["scene"]["reach"] == 0.25


@on_page
async def test_pages_cut_the_scene(browser, client):
    up = {"normal": [0, 2, 0], "offset": 0.5}
    edit = {"type": "edit", "part": "", "key": "cuts", "step": 1}
    await browser.send(**edit, value={"planes": [up]})
    await browser.send(**edit, value={"planes": [up, up], "faces": "unlit"}, title="two planes")
    cuts = (await browser.past("two planes"))["scene"]["cuts"]
    assert cuts == {"planes": 2 * [{"normal": [0, 1, 0], "offset": 0.25}], "box": None, "faces": "unlit"}
    sliced = {"planes": [up], "faces": "slice", "window": [-1, 0.5]}
    await browser.send(**edit, value=sliced, title="slices")
    cuts = (await browser.past("slices"))["scene"]["cuts"]
    assert (cuts["faces"], cuts["window"]) == ("slice", [-1, 0.5])
    await browser.send(type="undo")
    await browser.past()
    assert isolated(client.server_side.edits.scene, "TF01").cuts == NO_CUTS, "clicks select what is whole"
    await browser.send(type="undo")
    assert (await browser.past())["scene"]["cuts"] == {"planes": [], "box": None, "faces": "shaded"}


@on_page
async def test_edits_of_one_movement_are_one_step(browser):
    for value in (0.9, 0.5, -1, 0.2):
        await browser.send(type="edit", part="TF01", key="opacity", value=value, step=1)
    await browser.send(type="edit", part="TF01", key="opacity", value=0.1, step=2)
    news = await browser.past("TF01 opacity 0.2", "TF01 opacity 0.1")
    assert news["scene"]["models"][0]["edit"]["opacity"] == 0.1
    for step, opacity in (("undo", 0.2), ("undo", 1), ("redo", 0.2)):
        await browser.send(type=step)
        assert (await browser.next("scene"))["scene"]["models"][0]["edit"]["opacity"] == opacity


@on_page
async def test_a_movement_goes_on_from_its_own_step_only(browser, client):
    """Others edit the same session, as Python beside a viewer in a notebook."""
    move = {"type": "edit", "part": "", "key": "background", "step": 7}
    await browser.send(**move, value=[1, 0, 0])
    await browser.past("background [1, 0, 0]")
    client.server_side.edits.session.set("TF01", "opacity", 0.5)
    await browser.send(**move, value=[0, 0, 1])
    news = await browser.past("background [1, 0, 0]", "", "background [0, 0, 1]")
    assert news["scene"]["models"][0]["edit"]["opacity"] == 0.5


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        ({"part": "TF03", "key": "opacity", "value": 1}, "a model of the scene (TF01, TF02), got TF03"),
        ({"part": "", "key": "light", "value": "up"}, "expected headlight, or azimuth and polar"),
        ({"part": "", "key": "shadows", "value": "dark"}, "light.shadows: expected a number, got 'dark'"),
        (
            {"part": "", "key": "occlusion", "value": 0.5},
            "light: expected the volume of the scene for shadows",
        ),
        ({"part": "", "key": "cuts", "value": {"planes": 3}}, "cuts.planes: expected"),
        (
            {"part": "", "key": "markers", "value": [{"points": 3}]},
            "markers.0.points: expected a list, got 3",
        ),
        (
            {"part": "", "key": "markers", "value": [{"points": [[0, 0, 0]]}] * 101},
            "0 to 100 values, got 101",
        ),
    ],
)
@on_page
async def test_edits_that_cannot_be_made_are_notices(browser, edit, message):
    await browser.send(type="edit", **edit)
    assert message in (await browser.next("notice"))["text"]
    assert (await browser.next("scene"))["past"] == []


@on_page
async def test_scenes_are_saved_in_their_folder_only(browser, scene_file):
    await browser.send(type="edit", part="TF02", key="visible", value=False)
    for name in ("../a.yaml", "/tmp/a.yaml", "a\\b.yaml", ".a.yaml", "", "a.txt", "a\0.yaml"):
        assert "save as: expected a name" in (await saved(browser, name, replace=True))["text"]
    assert (await saved(browser, "new.yaml"))["level"] == "info"
    news = await browser.next("scene")
    assert (news["saved"], news["file"]) == (True, "new.yaml")
    assert (await saved(browser, "scene.yaml"))["level"] == "info", "it is what was opened"
    for name in ("scene.yaml", "new.yaml"):
        assert not read_scene(scene_file.parent / name).models["TF02"].edit.visible


@pytest.fixture
def earlier(scene_file, monkeypatch):
    """What somebody has saved of a scene that a job wrote."""
    own = scene_file.parent / "own"
    own.mkdir()
    monkeypatch.chdir(own)
    (scene_file.parent / "metrics.json").write_text("{}")
    for name in ("scene.yaml", "edited.yaml"):
        write_scene(own / name, read_scene(scene_file))
    return own / "edited.yaml"


@on_page
async def test_quotes_in_names_of_scenes(browser, client):
    assert (await saved(browser, 'a "b".yaml'))["level"] == "info"
    status, _, headers = await still(client, json.dumps({"camera": CAMERA}))
    assert (status, headers["Content-Disposition"]) == (200, "attachment")


@on_page
async def test_other_files_are_replaced_after_a_question_only(browser, scene_file, earlier):
    await browser.send(type="edit", part="TF02", key="visible", value=False)
    for name in ("edited.yaml", "scene.yaml"):
        notice = await saved(browser, name)
        assert (notice["level"], notice["name"]) == ("question", name)
    assert read_scene(earlier).models["TF02"].edit.visible
    assert (await saved(browser, "edited.yaml", replace=True))["level"] == "info"
    assert not read_scene(earlier).models["TF02"].edit.visible
    assert read_scene(scene_file).models["TF02"].edit.visible


@on_page
async def test_a_file_that_others_have_written_is_replaced_after_a_question_only(browser, scene_file):
    await browser.send(type="edit", part="TF02", key="visible", value=False)
    assert (await saved(browser, "scene.yaml"))["level"] == "info"
    assert main(["edit", str(scene_file), "TF01.opacity=0.25", "--output", str(scene_file)]) == 0
    assert (await saved(browser, "scene.yaml"))["level"] == "question"
    assert read_scene(scene_file).models["TF01"].edit.opacity == 0.25


@on_page
async def test_a_scene_whose_model_is_gone_is_not_saved(browser, scene_file):
    (model := scene_file.parent / "TF01.safetensors").rename(away := scene_file.parent / "away")
    for is_saved in (False, True):
        notice = await saved(browser, "new.yaml")
        assert notice["level"] == ("info" if is_saved else "error")
        assert is_saved or notice["text"] == (
            f"{model}: no such file, which the scene needs; bring it back, then try again"
        )
        assert (scene_file.parent / "new.yaml").exists() is is_saved
        if not is_saved:
            away.rename(model)


@on_page
async def test_a_thousand_malformed_messages(browser, caplog):
    rng, whole = np.random.default_rng(0), json.dumps(VIEW)
    for number in range(1000):
        if number % 3 == 0:
            await browser.socket.send_bytes(rng.bytes(20))
        elif number % 3 == 1:
            await browser.socket.send_str(whole[: rng.integers(len(whole))])
        else:
            letters = list(whole)
            letters[rng.integers(len(whole))] = chr(rng.integers(1, 0x250))
            await browser.socket.send_str("".join(letters).replace("view", "edit", int(number % 2)))
    assert (await browser.next("notice"))["level"] == "error"
    await browser.send(**VIEW)
    await browser.next("frame")
    assert "Traceback" not in caplog.text


@on_page
async def test_a_step_to_a_model_that_is_gone_is_refused_and_taken_back(browser, client, scene_file):
    edits, models = client.server_side.edits, scene_file.parent
    copy(models / "TF02.safetensors", finer := models / "finer.safetensors")
    entry = replace(edits.scene.models["TF01"], file=finer)
    edits.session.set_scene(replace_entry(edits.scene, "TF01", entry))
    (models / "TF01.safetensors").unlink()
    await browser.send(type="undo")
    assert "TF01.safetensors: no such file, which the scene needs" in (await browser.next("notice"))["text"]
    assert edits.scene.models["TF01"].file == finer
    assert len(edits.state()["past"]) == 1
    async with page(client) as other:
        await other.next("scene")


@on_page
async def test_a_scene_may_have_all_the_functions_that_it_can_hold(browser, client):
    points = [[x / 255, 0.123456789] for x in range(256)]
    colors = [[x / 255, *[0.123456789] * 3] for x in range(256)]
    functions = {f"f{n}": {"opacity": points, "color": colors} for n in range(MAX_FUNCTIONS)}
    await browser.send(type="edit", part="", key="functions", value=functions)
    while len(client.server_side.edits.scene.functions) < MAX_FUNCTIONS:
        await browser.next("scene")


@on_page
async def test_messages_have_a_limit(client, monkeypatch):
    monkeypatch.setattr("texgs.viewer.server.MESSAGE_BYTES", 1 << 16)
    async with page(client) as one:
        await one.socket.send_str("x" * 100_000)
        while (message := await asyncio.wait_for(one.socket.receive(), WAIT)).type == WSMsgType.TEXT:
            pass
    assert message.type == WSMsgType.CLOSE
    async with page(client) as again:
        await again.next("scene")


def test_a_page_hears_of_its_server_while_nothing_happens(scene_file, monkeypatch):
    async def work():
        async with served(scene_file) as client, page(client) as browser:
            for _ in range(2):
                await browser.next("beat")

    monkeypatch.setattr("texgs.viewer.page.BEAT", 0.01)
    asyncio.run(work())


@on_page
async def test_there_are_so_many_pages_at_most(browser, client, monkeypatch):
    monkeypatch.setattr("texgs.viewer.server.MOST_PAGES", 1)
    async with page(client) as other:
        message = await asyncio.wait_for(other.socket.receive(), WAIT)
        assert (message.type, message.data) == (WSMsgType.CLOSE, WSCloseCode.TRY_AGAIN_LATER)
        assert message.extra.startswith("1 pages of this scene are open")
    async with page(client) as other:
        assert (await asyncio.wait_for(other.socket.receive(), WAIT)).type == WSMsgType.CLOSE
    assert browser.socket.closed is False
