"""Transfer functions are edited over the histogram in a real browser: the volume shows them at once."""

import re
from dataclasses import replace
from urllib.parse import quote

import numpy as np

from tests.config.kept import project
from tests.viewer.in_browser import (
    JPEG,
    WAIT,
    drag,
    expect,
    opened,
    pixels,
    rendered,
    save_as,
    served,
    shown,
    still,
)
from texgs.scene.scene_file import read_scene, write_scene
from texgs.viewer.standalone import web_file


def test_what_is_dragged_is_the_volume_that_texgs_renders(chromium, sphere_file):
    with served(sphere_file) as (_, address), opened(chromium, address) as page:
        before = still(page)
        drag(page, page.get_by_role("slider", name="Point 2 of low"), (0.5, 0.5), (6, -3))
        expect(page.get_by_label("Show", exact=True)).to_have_value("volume")
        expect(page.get_by_role("listitem")).to_have_text([re.compile(r"^functions low opacity at [\d.]+$")])
        save_as(page, "tried.yaml")
        tried = read_scene(sphere_file.parent / "tried.yaml")
        basic, edited = tried.volume.tfs["low"], tried.functions["low"]
        assert edited.opacity[1] != basic.opacity[1]
        assert (edited.opacity[0], edited.opacity[2]) == (basic.opacity[0], basic.opacity[2])
        picture = still(page)
        assert picture == rendered(sphere_file.parent / "tried.yaml", page, "--mode", "volume")
        assert np.abs(shown(page) - pixels(picture)[:-50]).mean() < JPEG
        page.get_by_role("button", name="Undo").click()
        page.get_by_label("Show", exact=True).select_option("Shaded")
        assert still(page) == before


def test_a_scene_whose_volume_has_no_function_is_shown_without_the_editor(chromium, sphere_file):
    scene = read_scene(sphere_file)
    write_scene(sphere_file, replace(scene, volume=replace(scene.volume, tfs={})))
    with served(sphere_file) as (_, address), opened(chromium, address) as page:
        expect(page.get_by_role("button", name="Make model")).to_have_count(0)
        assert still(page)


def test_a_function_that_moves_as_a_whole_stays_one_of_its_channel(chromium):
    page = chromium.new_page()
    tf = {"opacity": [[0.2, 0.0], [0.4, 0.5]], "color": [[0.3, 1.0, 0.0, 0.0]], "channel": 2}
    module = "data:text/javascript," + quote(web_file("functions.js"))
    moved = page.evaluate(f"tf => import('{module}').then((m) => m.shifted(tf, 0.5, [0, 1]))", tf)
    page.close()
    assert moved == {
        "opacity": [[0.7, 0.0], [0.9, 0.5]],
        "color": [[0.8, 1.0, 0.0, 0.0]],
        "channel": 2,
    }


def test_functions_stand_in_the_link(chromium, sphere_file):
    with served(sphere_file) as (_, address), opened(chromium, address) as page:
        page.get_by_role("slider", name="Point 2 of low").press("ArrowUp")
        expect(page).to_have_url(re.compile("functions"), timeout=WAIT)
        link = page.url
        page.get_by_role("button", name="Undo").click()
        for wrong in ("[[0,2]]", "3"):
            page.goto("about:blank")
            page.goto(re.sub("%5B%5B.*?%5D%5D", wrong, link))
            expect(page.get_by_text("This page cannot use of the link: functions.")).to_be_visible()
        page.goto("about:blank")
        page.goto(link)
        page.get_by_role("button", name="Make it on all pages").click()
        expect(page.get_by_role("listitem")).to_have_text([re.compile(r"^functions low opacity at [\d.]+$")])


def test_keys_and_numbers_move_points(chromium, sphere_file):
    with served(sphere_file) as (_, address), opened(chromium, address) as page:
        point = page.get_by_role("slider", name="Point 2 of low")
        value, alpha = page.get_by_label("Value of the point"), page.get_by_label("Opacity of the point")
        first = float(alpha.input_value())
        point.press("ArrowUp")
        expect(alpha).to_have_value(f"{first + 0.005:g}")
        point.press("Shift+ArrowDown")
        expect(alpha).to_have_value(f"{first - 0.045:g}")
        alpha.fill("0.25")
        value.fill("-1000")  # not below the point before it
        value.press("Tab")
        save_as(page, "moved.yaml")
        points = read_scene(sphere_file.parent / "moved.yaml").functions["low"].opacity
        assert points[1][1] == 0.25
        assert points[0][0] < points[1][0] < points[0][0] + 0.01 * (points[2][0] - points[0][0])
        point.press("Delete")  # two transparent points would be left
        save_as(page, "again.yaml")
        assert len(read_scene(sphere_file.parent / "again.yaml").functions["low"].opacity) == 3


def test_points_and_functions_are_added_and_removed(chromium, sphere_file):
    with served(sphere_file) as (_, address), opened(chromium, address) as page:
        editor, points = (
            page.locator("#transfer svg"),
            page.get_by_role("slider", name=re.compile("^Point . of")),
        )
        name = page.get_by_role("button", name="high", exact=True)
        name.press("Enter")
        expect(name).to_be_focused()
        expect(points).to_have_count(3)
        said = (points.nth(1).get_attribute(f"aria-value{each}") for each in ("min", "now", "max"))
        low, value, high = map(float, said)
        assert low <= value <= high
        editor.dblclick(position={"x": 10, "y": 10})
        expect(points).to_have_count(4)
        points.nth(0).dblclick()
        expect(points).to_have_count(3)
        page.get_by_label("Colours of a preset").select_option("Viridis")
        expect(page.get_by_role("slider", name=re.compile("^Colour"))).to_have_count(9)
        page.get_by_role("slider", name="Colour 2 of high").focus()
        page.get_by_label("Colour of the point").fill("#ff0000")
        page.get_by_role("button", name="Copy", exact=True).click()
        page.get_by_role("button", name="New", exact=True).click()
        save_as(page, "more.yaml")
        functions = read_scene(sphere_file.parent / "more.yaml").functions
        assert list(functions) == ["high", "TF03", "TF04"]
        assert functions["TF03"] == functions["high"]
        assert functions["high"].color[1][1:] == (1, 0, 0)
        page.get_by_role("button", name="Delete").click()
        page.get_by_role("button", name=re.compile("^high")).click()
        page.get_by_role("button", name="As fitted").click()
        save_as(page, "fewer.yaml")
        assert list(read_scene(sphere_file.parent / "fewer.yaml").functions) == ["TF03"]
        editor.hover(position={"x": 150, "y": 20})
        words = re.compile(r"^[\d.]+(: ([\d.]+ % of|not in) the volume)?$")  # no more without a histogram
        expect(page.locator("#transfer .readout")).to_have_text(words)


def test_a_model_of_a_function_is_begun_and_cancelled(chromium, sphere_file):
    with served(sphere_file) as (_, address), opened(chromium, address) as page:
        make = page.get_by_role("button", name="Make model")
        expect(make).to_be_disabled()
        page.get_by_role("button", name="New", exact=True).click()
        make.click()
        expect(page.locator("#job-title")).to_have_text(re.compile("TF03, (views|pass 1)"), timeout=WAIT)
        page.get_by_role("button", name="Cancel").first.click()
        expect(page.get_by_text("it was cancelled; nothing has changed")).to_be_visible(timeout=WAIT)
        expect(page.get_by_role("listitem")).to_have_text(["functions TF03 new"])
        assert not list(sphere_file.parent.glob("*TF03*"))


def test_a_function_is_kept_in_its_data_set(chromium, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scene = write_scene(tmp_path / "scene.yaml", project(tmp_path))
    with served(scene) as (_, address), opened(chromium, address) as page:
        page.get_by_role("button", name="over *", exact=True).click()
        page.get_by_role("button", name="Keep in data set").click()
        expect(page.get_by_text(re.compile("over: .*do not overlap"))).to_be_visible(timeout=WAIT)
        page.get_by_role("button", name="TF03 *", exact=True).click()
        page.get_by_role("button", name="Keep in data set").click()
        expect(page.get_by_text("TF03 is a basic transfer function")).to_be_visible(timeout=WAIT)
    assert "\n    TF03:\n" in (tmp_path / "conf" / "dataset" / "mine.yaml").read_text()
