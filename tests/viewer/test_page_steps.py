"""The steps of a series that a page carries: their numbers, and what a browser shows of them."""

import io
import json
import re
import shlex
import zlib
from base64 import b64decode
from contextlib import ExitStack
from dataclasses import replace

import numpy as np
import pytest
import torch
from PIL import Image
from safetensors.numpy import load
from torch.nn.functional import normalize

from tests.viewer.drawing import closeness, unpacked
from tests.viewer.drawn_scenes import BEGIN, COUNT, scene_of_series
from tests.viewer.in_browser import (
    LINK,
    PLACE,
    WAIT,
    expect,
    opened_file,
    served,
    settle,
    shown,
    standalone,
    still,
)
from tests.viewer.in_browser import opened as opened_viewer
from texgs.cli.main import main
from texgs.core.camera import orbit
from texgs.core.errors import ArgumentError
from texgs.scene.frame import frame
from texgs.scene.scene_file import read_scene
from texgs.viewer.page_steps import UNITS, page_steps
from texgs.viewer.standalone import pack, scene_page

CLOSE = 50.0  # dB: the page rounds surfels and texels


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return scene_of_series(tmp_path_factory.mktemp("series"))


# ---- Numbers ----------------------------------------------------------------


@pytest.mark.parametrize("time", range(COUNT))
def test_sums_are_the_surfels_of_the_step(scene, time):
    """Read without the code that wrote them; a look keeps its colours."""
    base = unpacked(pack(scene.open()))[0][1].parameters
    tensors = load(zlib.decompress(b64decode(page_steps(scene).packed[time])))
    assert list(tensors) == ["1.codes"], "the other model does not follow the series"
    whole = sum(plane.astype(np.int64) << 8 * k for k, plane in enumerate(tensors["1.codes"]))
    rows = np.where(whole % 2, -(whole + 1) // 2, whole // 2)
    true, row = scene.at(time).models["A"].open()[0].parameters, 0
    for name, unit in UNITS.items():
        is_turn = name in ("quats", "normals")
        values = normalize(base[name], dim=1) if is_turn else base[name]
        sums = values.reshape(300, -1).double() + unit * torch.tensor(rows[row : row + values[0].numel()].T)
        expected = normalize(true[name], dim=1) if is_turn else true[name].reshape(300, -1)
        row += values[0].numel()
        if is_turn:
            assert (normalize(sums, dim=1) * expected).sum(dim=1).abs().min() > 1 - 1e-5
        else:
            assert (sums - expected).abs().max() < 0.55 * unit, "half a unit, and half precision of the base"
    assert row == len(rows)


def test_steps_are_chosen_around_that_of_the_scene(scene):
    packed = page_steps(scene).packed
    assert list(packed) == [0, 1, 2, 3, 4]
    assert page_steps(scene).packed == packed, "the same bytes"
    assert list(page_steps(scene, "2").packed) == [0, 2, 4]
    assert list(page_steps(scene.at(3), 2).packed) == [1, 3]
    assert page_steps(scene, "one").packed == page_steps(scene, 3).packed | {BEGIN: ""} == {BEGIN: ""}
    assert str(page_steps(scene, "one")) == "step 2 alone, of 5 in the series"
    assert re.fullmatch(r"3 of 5 steps in 0\.0\d MB", str(page_steps(scene, 2)))


@pytest.mark.parametrize("steps", ["0", "none", -1, 1.5, True])
def test_steps_that_are_none_are_refused(scene, steps):
    with pytest.raises(
        ArgumentError, match=r"^steps: expected all, one or a number N for each N-th step, got"
    ):
        page_steps(scene, steps)


def test_a_scene_without_a_series_has_none_of_it(scene):
    alone = replace(scene, series=None, time=None)
    assert page_steps(alone) is None
    with pytest.raises(ArgumentError, match=r"^steps: expected a series in time for 'one', got"):
        page_steps(alone, "one")
    html = scene_page(alone, "x").text
    assert '"held"' not in html
    assert 'id="time"' not in html
    assert 'class="step"' not in html


# ---- The page ---------------------------------------------------------------


@pytest.fixture
def opened(chromium, scene):
    """Opens pages of exports with some words."""
    source = scene.series.file.with_name("scene.yaml")
    with ExitStack() as pages:
        yield lambda *words, link=LINK: pages.enter_context(standalone(chromium, source, *words, link=link))


def slider(page):
    return page.get_by_label("Step in time")


def saved(page):
    """The picture that the page saves."""
    return np.asarray(Image.open(io.BytesIO(still(page))).convert("RGB"))


def expected(seen, picture):
    """The frame of a scene for the page's camera."""
    height, width = picture.shape[:2]
    lens = PLACE["distance"], PLACE["fov_y"], width, height
    return frame(seen.open(), orbit(PLACE["azimuth"], PLACE["polar"], *lens), seen)


def test_the_slider_shows_steps_and_the_link_has_them(opened, scene, capsys):
    page = opened()
    assert re.search(r"Series in the page: 5 of 5 steps in 0\.\d\d MB", capsys.readouterr().err)
    assert slider(page).input_value() == str(BEGIN)
    picture = saved(page)
    assert closeness(picture, expected(scene, picture)) > CLOSE
    slider(page).fill("4")
    picture = saved(page)  # which waits for the step
    assert closeness(picture, expected(scene.at(4), picture)) > CLOSE
    assert shlex.split(page.locator("#words textarea").input_value()) == ["time=4"]
    page.wait_for_url(re.compile("time"))
    page.get_by_role("button", name="Keep this view").click()
    page.wait_for_url(re.compile("bookmarks=.*time"))
    again = opened(link=page.url[page.url.index("#") :])
    assert slider(again).input_value() == "4"
    assert closeness(saved(again), picture) > 60
    page.get_by_role("button", name="Undo").click()
    assert slider(page).input_value() == str(BEGIN)


def test_what_is_on_screen_follows(opened, scene):
    page = opened()
    for time in (0, 4):
        slider(page).fill(str(time))
        page.wait_for_timeout(300)
        settle(page)
        size = page.locator("#picture").evaluate("picture => [picture.height, picture.width]")
        rendered = expected(scene.at(time), np.empty(size))
        assert closeness(shown(page), rendered[:-50]) > CLOSE - 10


def test_the_button_plays_all_steps_in_turn_as_one_edit(opened):
    page = opened()
    page.get_by_label("Opacity of B", exact=True).fill("0.5")
    page.evaluate(
        "() => { const output = document.querySelector('#time output'); globalThis.seen = [];"
        " const see = () => seen.push(Number(output.textContent));"
        " new MutationObserver(see).observe(output, { childList: true }); }"
    )
    page.get_by_role("button", name="Play").click()
    while page.evaluate("seen.length") < 6:
        page.wait_for_timeout(100)
    page.get_by_role("button", name="Pause").click()
    seen = page.evaluate("seen")
    assert seen[:6] == [3, 4, 0, 1, 2, 3]
    names = page.get_by_role("list", name="Steps", exact=True).get_by_role("listitem").all_text_contents()
    assert names == ["B opacity 0.5", f"time {seen[-1]}"]
    page.wait_for_timeout(600)
    assert page.evaluate("seen.length") == len(seen), "it has stopped"


def test_each_nth_step(opened, scene):
    page = opened("--steps", "2")
    assert page.get_by_text("The page has 3 of 5 steps in 0.").is_visible()
    assert slider(page).get_attribute("max") == "2"
    slider(page).fill("2")
    assert shlex.split(page.locator("#words textarea").input_value()) == ["time=4"]
    picture = saved(page)
    assert closeness(picture, expected(scene.at(4), picture)) > CLOSE
    for time in (1, None):
        edit = [{"part": "", "key": "time", "value": time}]
        page.evaluate("words => { location.hash = new URLSearchParams(words); }", {"edits": json.dumps(edit)})
        page.get_by_text("This page cannot use of the link: time.").wait_for()
        page.get_by_label("Close").click()


def test_one_step_alone(opened, scene):
    page = opened("--steps", "one")
    assert page.get_by_text("The page has step 2 alone, of 5 in the series.").is_visible()
    assert slider(page).is_hidden()
    picture = saved(page)
    assert closeness(picture, expected(scene, picture)) > CLOSE


def test_the_volume_is_that_of_one_step(opened, scene):
    page = opened("--volume")
    assert page.get_by_text("Its volume is that of step 2").is_visible()
    page.get_by_label("Show", exact=True).select_option("wipe")
    page.get_by_role("button", name="Add a plane").click()
    slider(page).fill("3")
    told = page.get_by_text("The volume in this page is that of step 2: go there to see it.")
    expect(told).to_be_visible()
    assert page.get_by_label("Show", exact=True).input_value() == "shaded"
    off = page.locator("#mode option:disabled").evaluate_all("all => all.map((each) => each.value)")
    assert off == ["volume", "difference", "wipe"]
    picture = saved(page)
    source = scene.series.file.with_name("scene.yaml")
    words = shlex.split(page.locator("#words textarea").input_value())
    cut = source.with_name("cut.yaml")
    assert main(["edit", str(source), *words, "--output", str(cut)]) == 0
    assert read_scene(cut).time == 3
    assert closeness(picture, expected(read_scene(cut), picture)) > CLOSE - 10, "hollow"
    slider(page).fill("2")
    assert page.locator("#mode option:disabled").count() == 0
    page.get_by_label("Show", exact=True).select_option("volume")
    assert page.get_by_label("Show", exact=True).input_value() == "volume"


def test_a_damaged_step_is_told_and_the_others_stay(chromium, scene, tmp_path):
    text, file = page_steps(scene).packed[4], tmp_path / "page.html"
    file.write_text(scene_page(scene, "x").text.replace(text, text[: len(text) // 8 * 4]))
    with opened_file(chromium, file) as page:
        slider(page).fill("4")
        expect(page.get_by_text("The scene in this page cannot be unpacked")).to_be_visible()
        slider(page).fill("3")
        picture = saved(page)
        assert closeness(picture, expected(scene.at(3), picture)) > CLOSE


def test_the_viewer_asks_which_steps_a_page_holds(chromium, scene):
    file = scene.series.file.with_name("scene.yaml")
    with served(file) as (_, address), opened_viewer(chromium, address) as viewer:
        viewer.get_by_role("button", name="Export").click()
        dialog, asked = viewer.get_by_role("dialog"), viewer.get_by_role("combobox", name="Steps in time")
        number = dialog.get_by_role("spinbutton", name="N", exact=True)
        expect(asked).to_be_hidden()  # a film first
        dialog.get_by_label("As").select_option("Web page")
        expect(number).to_be_hidden()
        asked.select_option("Each N-th")
        number.fill("2")
        with viewer.expect_download(timeout=WAIT) as download:
            dialog.get_by_role("button", name="Export").click()
        assert download.value.path().read_text().count('class="step"') == 3


def test_series_that_are_too_large_are_refused(scene, tmp_path, monkeypatch):
    monkeypatch.setattr("texgs.viewer.standalone.LARGEST", len(pack(scene.open())))
    assert scene_page(scene, "x", steps="one").steps.total == COUNT
    with pytest.raises(ArgumentError, match=r"of them; export fewer models or steps$"):
        scene_page(scene, "x")
