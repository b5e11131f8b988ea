"""Cameras that a page keeps: they are gone to, removed, in the link, and on the way of a film."""

import re
import shutil

import numpy as np
from PIL import Image, ImageSequence

from tests.viewer.in_browser import WAIT, expect, opened, pixels, served, standalone, still
from texgs.cli.main import main

FIRST, SECOND = "azimuth 40°, polar 10°", "azimuth 60°, polar 10°"


def keep_two(page):
    """Keep the view that the page begins with, and one that is 20 degrees beside it."""
    keep = page.get_by_role("button", name="Keep this view")
    keep.click()
    for _ in range(4):
        page.locator("#picture").press("ArrowLeft")
    keep.click()
    kept = page.get_by_role("list", name="Bookmarks").get_by_role("listitem")
    expect(kept).to_have_text([f"{FIRST}×", f"{SECOND}×"])
    page.get_by_role("button", name=FIRST).click()
    expect(page).to_have_url(re.compile("#azimuth=40&"), timeout=WAIT)
    return kept


def exported(page, kind, way):
    """The path of a film, or of its keys."""
    page.get_by_role("button", name="Export").click()
    dialog = page.get_by_role("dialog")
    dialog.get_by_label("As").select_option(kind)
    dialog.get_by_label("Camera").select_option(way)
    dialog.get_by_label("Length, seconds").fill("0.3")
    dialog.get_by_label("Frames a second").fill("10")
    with page.expect_download(timeout=WAIT) as download:
        dialog.get_by_role("button", name="Export").click()
    return download.value.path()


def film(page, way="Through the bookmarks"):
    """Frames of a film."""
    with Image.open(exported(page, "Film, GIF", way)) as frames:
        return [np.asarray(each.convert("RGB")).astype(int) for each in ImageSequence.Iterator(frames)]


def test_a_film_goes_through_the_bookmarks_of_the_viewer(chromium, scene_file):
    with served(scene_file) as (_, address), opened(chromium, address) as page:
        page.get_by_role("button", name="Export").click()
        way = page.get_by_role("dialog").get_by_label("Camera")
        expect(way.get_by_role("option", name="Through the bookmarks", exact=True)).to_be_disabled()
        page.keyboard.press("Escape")
        keep_two(page)
        ends = [pixels(still(page))]
        page.get_by_role("button", name=SECOND).click()
        ends.append(pixels(still(page)))
        frames = film(page)
        assert len(frames) == 3
        for k in range(2):
            first, middle, last = (np.abs(frame - ends[k]).mean() for frame in frames)
            assert 2 * (first, last)[k] < min(middle, (last, first)[k])


def test_edits_of_bookmarks_come_back_and_move_in_films_that_the_command_line_makes_again(
    chromium, scene_file, tmp_path
):
    with served(scene_file) as (_, address), opened(chromium, address) as page:
        keep = page.get_by_role("button", name="Keep this view")
        keep.click()
        again = page.get_by_role("button", name="Go to bookmark 1 and make its edits again")
        expect(again).to_be_hidden()
        page.get_by_role("spinbutton", name="Opacity of TF01, as a number").fill("0.1")
        expect(again).to_be_visible()
        keep.click()
        edited = pixels(still(page))
        again.click()
        expect(page.get_by_role("spinbutton", name="Opacity of TF01, as a number")).to_have_value("1")
        fitted = pixels(still(page))
        assert np.abs(edited - fitted).mean() > 1
        shown = film(page, "Bookmarks with their edits")
        assert [np.abs(shown[at] - end).mean() < 3 for at, end in ((0, fitted), (2, edited))] == [True, True]
        plain = film(page)
        assert np.abs(plain[-1] - fitted).mean() < 3, "of the scene as it is"
        made = exported(page, "Keys of a film, YAML", "Bookmarks with their edits")
        keys = shutil.copy(made, tmp_path / "scene-keys.yaml")  # the browser removes its own
        told = page.get_by_text("This film again: texgs render scene.yaml --film scene-keys.yaml")
        words = re.search("--width .* --fps 10", told.inner_text())[0].split()
        second = page.get_by_role("button", name="Go to bookmark 2 and make its edits again")
        second.click()
        expect(again).to_be_visible()
        page.reload()
        expect(again, "the link has the edits of both").to_be_visible()
        expect(second).to_be_hidden()
        again.click()
        expect(second).to_be_visible()
    folder = tmp_path / "film"
    assert main(["render", str(scene_file), "--film", str(keys), *words, "--output", str(folder)]) == 0
    for at, frame in enumerate(sorted(folder.iterdir())):
        assert np.abs(np.asarray(Image.open(frame)).astype(int) - shown[at]).mean() < 3, (
            "of the colours of a GIF"
        )


def test_bookmarks_stay_in_the_link_of_the_standalone_page(chromium, scene_file):
    with standalone(chromium, scene_file) as page:
        kept = keep_two(page)
        # The link follows when the view rests; before, it may say the same of the camera.
        expect(page).to_have_url(re.compile("#azimuth=40&.*&bookmarks=40%2C10%2C.*60%2C10%2C"), timeout=WAIT)
        page.reload()
        expect(kept).to_have_count(2)
        page.get_by_role("button", name="Remove bookmark 1").press("Enter")
        expect(page.get_by_role("button", name="Remove bookmark 1"), "of what was the second").to_be_focused()
        expect(kept).to_have_text([f"{SECOND}×"])
        kept.get_by_role("button", name=SECOND).click()
        expect(page).to_have_url(re.compile("#azimuth=60&.*&bookmarks=60%2C10%2C"), timeout=WAIT)
        page.evaluate("() => { location.hash = 'bookmarks=1,2;60,10,3,30,0,0,0'; }")
        expect(page.get_by_text("This page cannot use of the link: bookmarks.")).to_be_visible()
        expect(kept).to_have_count(1)
