"""A double click makes what is seen there the middle of the picture, in both pages."""

import pytest
import torch

from tests.viewer.in_browser import WAIT, camera_of, expect, opened, served, standalone
from texgs.scene.scene_file import read_scene

SEEN = (0.52, 0.44)  # parts of the picture
BACKGROUND = "There is only background."


def turns_around_what_is_seen(page, scene):
    """Double click on something and on the background; look at the command of the view before and after."""
    before, box = camera_of(page), page.locator("#picture").bounding_box()
    x, y = round(SEEN[0] * box["width"]), round(SEEN[1] * box["height"])
    begun = page.locator("#options").inner_text()
    page.mouse.dblclick(box["x"] + x, box["y"] + y)
    expect(page.locator("#options")).not_to_have_text(begun, timeout=WAIT)
    after = camera_of(page)
    torch.testing.assert_close(after.viewmat[:3, :3], before.viewmat[:3, :3], atol=1e-5, rtol=0)
    depth = scene.open().render(before, scene.light, scene.edits, outputs=("depth",)).depth
    ratio = before.width / box["width"]
    row, column = int(y * ratio), int(x * ratio)
    distance = float(-before.viewmat[2, :3] @ before.position)  # of the target, which was near the origin
    target = after.position + distance * after.viewmat[2, :3]
    place, z = before.project(target)
    torch.testing.assert_close(place, torch.tensor([column + 0.5, row + 0.5]), atol=0.2, rtol=0)
    assert float(z) == pytest.approx(float(depth[row, column]), abs=5e-3), "of the page, surfels are rounded"
    page.mouse.dblclick(box["x"] + 5, box["y"] + 5)
    expect(page.get_by_text(BACKGROUND)).to_be_visible(timeout=WAIT)
    assert camera_of(page).viewmat.equal(after.viewmat)


def test_a_double_click_turns_the_viewer_around_what_is_seen(chromium, scene_file):
    with served(scene_file) as (_, address), opened(chromium, address, ratio=2) as page:
        turns_around_what_is_seen(page, read_scene(scene_file))


def test_the_standalone_page_turns_around_what_is_seen_and_zooms_to_what_is_below_the_pointer(
    chromium, scene_file
):
    with standalone(chromium, scene_file) as page:
        turns_around_what_is_seen(page, read_scene(scene_file))
        page.locator("#picture").press("Home")
        before, box = camera_of(page), page.locator("#picture").bounding_box()
        page.mouse.move(box["x"] + 100, box["y"] + 60)
        page.mouse.wheel(0, -300)
        after = camera_of(page)
        distance = float(-before.viewmat[2, :3] @ before.position)  # of the target, near the origin
        ray = torch.linalg.inv(before.K) @ torch.tensor([100.0, 60.0, 1.0])
        point = before.viewmat[:3, :3].T @ (distance * ray - before.viewmat[:3, 3])
        place, depth = after.project(point)
        assert 0 < float(depth) < 0.9 * distance
        torch.testing.assert_close(place, torch.tensor([100.0, 60.0]), atol=1.5, rtol=0)
