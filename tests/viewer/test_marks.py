"""What lies over the picture: axes that lead to views, and a box around the scene or its volume."""

import math
import re
from contextlib import contextmanager
from dataclasses import replace
from urllib.parse import unquote

import pytest
import torch

from tests.scene.test_twin import HIGH, LOW, sphere_volume
from tests.viewer.in_browser import PLACE, WAIT, expect, opened, served, standalone
from texgs.core.camera import orbit
from texgs.scene.scene_file import read_scene, write_scene
from texgs.viewer.description import bounds
from texgs.volume.nrrd_file import open_grid

FROM = {"From +x": (0, 0), "From −z": (90, 0), "From +y": (-90, 90)}


@contextmanager
def viewer(chromium, scene_file):
    with served(scene_file) as (_, address), opened(chromium, address, ratio=2) as page:
        yield page


PAGES = pytest.mark.parametrize("opened_page", [viewer, standalone])


def with_sphere(scene_file, folder):
    """A scene file that names a volume, and the volume."""
    volume = sphere_volume(folder, TF01=LOW, TF02=HIGH)
    scene = replace(read_scene(scene_file), volume=volume)
    return write_scene(folder / "named.yaml", scene), volume


@PAGES
def test_ends_of_axes_lead_to_views(chromium, scene_file, opened_page):
    with opened_page(chromium, scene_file) as page:
        for name, (azimuth, polar) in FROM.items():
            page.locator(".gizmo .end", has=page.locator("title", has_text=name)).click()
            expect(page).to_have_url(re.compile(f"#azimuth={azimuth}&polar={polar}&"), timeout=WAIT)


@PAGES
def test_a_box_is_where_the_camera_sees_the_corners_of_the_volume(
    chromium, scene_file, opened_page, tmp_path
):
    named, volume = with_sphere(scene_file, tmp_path)
    with opened_page(chromium, named) as page:
        assert page.locator(".box path").first.get_attribute("d") == ""
        page.get_by_label("Bounds of the scene").check()
        drawn = [each.get_attribute("d") for each in page.locator(".box path").all()]
        box = page.locator("#picture").bounding_box()
    assert [each.count("M") for each in drawn] == [3, 9]
    numbers = torch.tensor([float(x) for x in re.findall(r"-?[\d.]+", "".join(drawn))]).reshape(-1, 2)
    camera = orbit(*PLACE.values(), round(box["width"]), round(box["height"]))
    low, high = open_grid(volume.file).aabb
    corners = torch.cartesian_prod(*torch.tensor([low, high]).T)
    distances = torch.cdist(camera.project(corners)[0], numbers)
    assert float(distances.amin(dim=1).max()) < 0.2
    assert (distances < 0.2).sum(dim=1).tolist() == [3] * 8


@PAGES
def test_the_bar_is_as_long_as_it_says_in_the_units_of_the_volume(
    chromium, scene_file, opened_page, tmp_path
):
    named, volume = with_sphere(scene_file, tmp_path)
    for file, name, scale in ((named, "volume", open_grid(volume.file).scale), (scene_file, "world", 1.0)):
        with opened_page(chromium, file) as page:
            length, *words = page.locator(".scale text").text_content().split()
            ends = re.findall(r"[\d.]+", page.locator(".scale path").get_attribute("d"))
            height = page.locator("#picture").bounding_box()["height"]
        assert words == [name, "units"]
        unit = height / 2 / PLACE["distance"] / math.tan(math.radians(PLACE["fov_y"] / 2)) * scale
        assert float(ends[4]) - float(ends[0]) == pytest.approx(float(length) * unit, abs=0.2)
        assert 50 < float(length) * unit <= 140


@PAGES
def test_a_link_is_copied_that_has_the_edits(chromium, scene_file, opened_page):
    with opened_page(chromium, scene_file) as page:
        page.context.grant_permissions(["clipboard-read", "clipboard-write"])
        page.get_by_role("checkbox", name="TF01").uncheck()
        page.get_by_role("button", name="Copy link").click()
        expect(page.get_by_text("Copied a link to this view")).to_be_visible()
        link = page.evaluate("navigator.clipboard.readText()")
        assert link.startswith(page.url.split("#")[0] + "#azimuth=40&polar=10&")
        assert '"part":"TF01","key":"visible","value":false' in unquote(link)
        page.evaluate("() => { navigator.clipboard.writeText = () => Promise.reject(new Error()); }")
        page.get_by_role("button", name="Copy link").click()
        expect(page.get_by_text("take the link from the address bar")).to_be_visible()


def test_without_a_volume_the_box_holds_the_models(scene_file):
    scene = read_scene(scene_file)
    told, means = bounds(scene, scene.open()), scene.open().means
    low, high = torch.tensor(told["low"]), torch.tensor(told["high"])
    assert told["scale"] is None
    assert float(((means > low) & (means < high)).all(dim=1).float().mean()) > 0.95
    assert float((high - low).max()) < 2 * told["radius"] + 1e-6
