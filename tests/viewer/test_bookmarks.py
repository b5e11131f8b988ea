"""Cameras that a page keeps: they are gone to, removed, in the link, and on the way of a film."""

import re

import numpy as np
from PIL import Image, ImageSequence

from tests.viewer.in_browser import WAIT, expect, opened, pixels, served, standalone, still

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


def film(page):
    """Frames of a film through the bookmarks."""
    page.get_by_role("button", name="Export").click()
    dialog = page.get_by_role("dialog")
    dialog.get_by_label("As").select_option("Film, GIF")
    dialog.get_by_label("Camera").select_option("Through the bookmarks")
    dialog.get_by_label("Length, seconds").fill("0.3")
    dialog.get_by_label("Frames a second").fill("10")
    with page.expect_download(timeout=WAIT) as download:
        dialog.get_by_role("button", name="Export").click()
    with Image.open(download.value.path()) as frames:
        return [np.asarray(each.convert("RGB")).astype(int) for each in ImageSequence.Iterator(frames)]


def test_a_film_goes_through_the_bookmarks_of_the_viewer(chromium, scene_file):
    with served(scene_file) as (_, address), opened(chromium, address) as page:
        page.get_by_role("button", name="Export").click()
        way = page.get_by_role("dialog").get_by_label("Camera")
        expect(way.get_by_role("option", name="Through the bookmarks")).to_be_disabled()
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
