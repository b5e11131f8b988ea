"""Distances and markers by clicks in both pages, and the legend: in the state, over the picture, in files."""

import json
import re
from dataclasses import replace
from urllib.parse import unquote

import numpy as np
import pytest
import torch

from tests.scene.test_twin import HIGH, LOW, sphere_volume
from tests.viewer.in_browser import (
    PLACE,
    WAIT,
    camera_of,
    expect,
    opened,
    pixels,
    rendered,
    save_as,
    served,
    standalone,
    still,
)
from texgs.core.camera import orbit
from texgs.scene.changes import apply_all
from texgs.scene.scene_file import read_scene, write_scene
from texgs.scene.session import Session
from texgs.volume.nrrd_file import open_grid

ENDS = ((0.52, 0.44), (0.47, 0.55))  # parts of the picture, where the scene is seen


@pytest.fixture
def named(scene_file, tmp_path):
    """The two balls, with a volume whose file is in millimetres."""
    volume = sphere_volume(tmp_path, TF01=LOW, TF02=HIGH)
    space = replace(open_grid(volume.file).world, unit="mm")
    scene = replace(read_scene(scene_file), volume=volume, space=space)
    return write_scene(tmp_path / "named.yaml", scene)


def click(page, place):
    box = page.locator("#picture").bounding_box()
    page.mouse.click(box["x"] + place[0] * box["width"], box["y"] + place[1] * box["height"])


def measure(page):
    """Make a distance and a marker with a text by clicks, and wait for both."""
    page.get_by_role("button", name="Measure").click()
    click(page, ENDS[0])
    expect(page.locator(".marker circle").first).to_be_visible(timeout=WAIT)
    click(page, ENDS[1])
    expect(page.locator("#markers li")).to_have_count(1, timeout=WAIT)
    page.get_by_role("button", name="Mark a point").click()
    click(page, ENDS[0])
    text = page.get_by_label("Text of marker 2")
    expect(text).to_be_focused(timeout=WAIT)
    text.fill("näve <b> 1")
    text.press("Enter")
    expect(page.locator(".marker text").nth(1)).to_have_text("näve <b> 1")


def drawn(page):
    """Places of circles over the picture, of markers in their order."""
    return [
        [float(each.get_attribute(key)) for key in ("cx", "cy")]
        for each in page.locator(".marker:not([hidden]) circle").all()
    ]


def looks_right(page, scene):
    """Compare what is drawn with the markers of a scene, by a camera and lengths of our own."""
    box = page.locator("#picture").bounding_box()
    camera = orbit(*PLACE.values(), round(box["width"]), round(box["height"]))
    points = [marker.points[i] for marker in scene.markers for i in (0, -1)]
    seen = camera.project(torch.tensor(points))[0].numpy()
    assert np.allclose(drawn(page), seen, atol=0.1)
    assert np.allclose(seen[:2] / (box["width"], box["height"]), ENDS, atol=0.003), "where the clicks were"
    places = scene.space.points(np.array(scene.markers[0].points))
    words = page.locator(".marker text").first.text_content()
    assert words == f"{np.linalg.norm(places[1] - places[0]):.3g} mm"
    assert page.locator("#markers li span").first.text_content() == words


def test_clicks_measure_and_mark_and_the_scene_keeps_it(chromium, named):
    with served(named) as (_, address), opened(chromium, address) as page:
        measure(page)
        save_as(page, "marked.yaml")
        scene = read_scene(named.with_name("marked.yaml"))
        assert [each.text for each in scene.markers] == ["", "näve <b> 1"]
        looks_right(page, scene)
        link = unquote(page.url)
        assert '"key":"markers"' in link
        picture = pixels(still(page))
        plain = pixels(rendered(named, page))
        assert np.array_equal(picture, pixels(rendered(named.with_name("marked.yaml"), page)))
        assert (picture != plain).any()
        turned = drawn(page)
        page.locator("#picture").press("ArrowLeft")
        page.wait_for_timeout(300)
        assert not np.allclose(drawn(page), turned, atol=1), "they follow the camera"
        page.get_by_label("Remove marker 1").click()
        expect(page.locator("#markers li")).to_have_count(1, timeout=WAIT)
        expect(page.get_by_label("Text of marker 1")).to_have_value("näve <b> 1")
        page.locator("#undo").click()
        expect(page.locator("#markers li")).to_have_count(2, timeout=WAIT)
        page.get_by_role("button", name="Remove all").click()
        expect(page.locator(".marker:not([hidden])")).to_have_count(0, timeout=WAIT)


def test_a_link_brings_markers_and_what_cannot_be_is_named(chromium, named):
    with served(named) as (_, address):
        scene = "/".join(named.resolve().parts[-4:])
        good = {"points": [[0, 0, 0.1]], "text": "linked"}
        for markers, is_good in (
            ([good], True),
            ([{**good, "points": [[0, 0]]}], False),
            ([good] * 101, False),
        ):
            words = json.dumps([{"part": "", "key": "markers", "value": markers}])
            with opened(chromium, address) as page:
                page.evaluate(
                    "([scene, edits]) => { location.hash += '&' + new URLSearchParams({ scene, edits }); }",
                    [scene, words],
                )
                if is_good:
                    expect(page.get_by_label("Text of marker 1")).to_have_value("linked", timeout=WAIT)
                    page.locator("#undo").click()
                else:
                    expect(page.get_by_text("This page cannot use of the link")).to_be_visible(timeout=WAIT)


def test_double_clicks_background_and_escape_measure_nothing(chromium, named):
    with served(named) as (_, address), opened(chromium, address) as page:
        before = camera_of(page)
        page.get_by_role("button", name="Measure").click()
        box = page.locator("#picture").bounding_box()
        page.mouse.dblclick(box["x"] + 0.52 * box["width"], box["y"] + 0.44 * box["height"])
        expect(page.locator(".marker:not([hidden])")).to_have_count(1, timeout=WAIT)
        page.wait_for_timeout(500)
        assert camera_of(page).viewmat.equal(before.viewmat)
        assert page.locator("#markers li").count() == 0, "both clicks are one point"
        click(page, (0.02, 0.1))
        expect(page.get_by_text("There is only background. Click")).to_be_visible(timeout=WAIT)
        page.locator("#picture").press("Escape")
        expect(page.locator(".marker:not([hidden])")).to_have_count(0)
        page.get_by_role("button", name="Measure").click()
        page.locator("#picture").press("Enter")
        expect(page.locator(".marker:not([hidden])")).to_have_count(1, timeout=WAIT)
        assert np.allclose(drawn(page), [[box["width"] / 2, box["height"] / 2]], atol=1)
        page.locator("#picture").press("Escape")
        expect(page.get_by_role("button", name="Measure")).to_have_attribute("aria-pressed", "false")
        click(page, ENDS[0])
        page.wait_for_timeout(500)
        assert page.locator("#markers li").count() == 0


def test_clicks_on_slices_are_points_of_a_distance(chromium, named):
    with served(named) as (_, address), opened(chromium, address) as page:
        page.get_by_role("button", name="Slices").click()
        page.get_by_role("button", name="Measure").click()
        canvas = page.locator("#slices canvas").first
        expect(canvas).to_be_visible()
        for share in (0.4, 0.6):
            box = canvas.bounding_box()  # the first click makes room for words
            page.mouse.click(box["x"] + share * box["width"], box["y"] + 0.5 * box["height"])
            page.wait_for_timeout(500)
        expect(page.locator("#markers li")).to_have_count(1, timeout=WAIT)
        save_as(page, "marked.yaml")
    scene = read_scene(named.with_name("marked.yaml"))
    grid = open_grid(scene.volume.file)
    samples = np.array(scene.markers[0].points) / grid.scale / grid.spacing + (np.array(grid.dims) - 1) / 2
    assert np.allclose(samples, np.rint(samples), atol=1e-6), "points are samples"
    assert sorted(np.ptp(np.rint(samples), axis=0) > 1) == [False, False, True], "along a row of a slice"


def test_the_standalone_page_measures_and_says_it_in_words(chromium, named):
    with standalone(chromium, named) as page:
        measure(page)
        words = page.locator("#words textarea").input_value()
        assert words.startswith("marker=none distance=")
        session = Session.open(named)
        shell = re.findall(r"'[^']*'|\S+", words)
        apply_all(session, [each.strip("'") for each in shell])
        looks_right(page, session.scene)
        assert session.scene.markers[1].text == "näve <b> 1"
        picture = pixels(still(page))
        page.get_by_role("button", name="Remove all").click()
        expect(page.locator("#words")).to_be_hidden()
        plain = pixels(still(page))
        (x, y), changed = drawn_at(ENDS[1], picture.shape), (picture != plain).any(axis=-1)
        assert picture[y, x].max() < 40, "a dot of the distance"
        assert changed.mean() < 0.1
        page.locator("#undo").click()
        expect(page.locator("#markers li")).to_have_count(2)


def drawn_at(place, shape):
    return round(place[0] * shape[1]), round(place[1] * shape[0])


@pytest.mark.parametrize("is_live", [True, False])
def test_a_legend_follows_edits_and_is_in_saved_pictures(chromium, named, is_live):
    def check(page):
        lines, tick = page.locator("#legend li"), page.get_by_role("checkbox", name="Legend")
        expect(page.locator("#legend")).to_be_hidden()
        plain = pixels(still(page))
        tick.check()
        expect(lines).to_have_count(2)
        low, high = read_scene(named).volume.tfs["TF01"].support
        assert lines.first.text_content() == f"TF01  {low:.4g} to {high:.4g}"
        marked = pixels(still(page))
        changed = np.argwhere((marked != plain).any(axis=-1))
        assert changed[:, 0].min() > marked.shape[0] / 2
        assert changed[:, 1].max() < marked.shape[1] / 2
        page.get_by_label("Palette of TF01", exact=False).first.fill("#ff0080")
        expect(lines.first.locator(".swatch")).to_have_attribute(
            "style", re.compile("255, 0, 128"), timeout=WAIT
        )
        page.get_by_role("checkbox", name="TF01", exact=True).uncheck()
        expect(lines).to_have_count(1, timeout=WAIT)
        if is_live:
            expect(page.locator("#options")).to_contain_text("--legend")
            save_as(page, "edited.yaml")
            assert np.array_equal(
                pixels(still(page)), pixels(rendered(named.with_name("edited.yaml"), page, "--legend"))
            )

    if is_live:
        with served(named) as (_, address), opened(chromium, address) as page:
            check(page)
    else:
        with standalone(chromium, named) as page:
            check(page)
