"""What lies over the picture: axes that lead to views, and a box around the scene or its volume."""

import re
from contextlib import contextmanager

import pytest
import torch

from tests.scene.test_twin import HIGH, LOW, sphere_volume
from tests.viewer.in_browser import PLACE, WAIT, expect, opened, served
from texgs.cli.main import main
from texgs.core.camera import orbit
from texgs.scene.scene_file import read_scene, write_scene
from texgs.viewer.description import bounds
from texgs.volume.nrrd_file import open_grid

FROM = {"From +x": (0, 0), "From −z": (90, 0), "From +y": (-90, 90)}


@contextmanager
def standalone(chromium, scene_file, ratio=1):
    """The page of an export at the camera of `in_browser.PLACE`."""
    file = scene_file.with_suffix(".html")
    assert main(["export", str(scene_file), "--to", str(file)]) == 0
    page = chromium.new_page(viewport={"width": 800, "height": 500}, device_scale_factor=ratio)
    place = "&".join(f"{key}={value}" for key, value in PLACE.items())
    page.goto(f"{file.as_uri()}#{place}&target=0,0,0")
    page.wait_for_selector("#picture[aria-busy=false]", timeout=WAIT)
    yield page
    page.close()


@contextmanager
def viewer(chromium, scene_file):
    with served(scene_file) as (_, address), opened(chromium, address, ratio=2) as page:
        yield page


PAGES = pytest.mark.parametrize("opened_page", [viewer, standalone])


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
    volume = sphere_volume(tmp_path, TF01=LOW, TF02=HIGH)
    scene = read_scene(scene_file)
    named = write_scene(tmp_path / "named.yaml", type(scene)(scene.models, volume=volume))
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


def test_without_a_volume_the_box_holds_the_models(scene_file):
    scene = read_scene(scene_file)
    told, means = bounds(scene, scene.open()), scene.open().means
    low, high = torch.tensor(told["low"]), torch.tensor(told["high"])
    assert told["scale"] is None
    assert float(((means > low) & (means < high)).all(dim=1).float().mean()) > 0.95
    assert float((high - low).max()) < 2 * told["radius"] + 1e-6
