"""Slices of the volume that a page holds: samples and places against those of texgs, and the page's panel."""

from base64 import b64decode, b64encode
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from tests.viewer.drawn_scenes import image_on, nested, scene_of_labels, waves
from tests.viewer.in_browser import WAIT, expect, settle, shown, standalone
from texgs.scene.scene_file import write_scene
from texgs.scene.twin import Twin
from texgs.viewer.description import describe
from texgs.viewer.page_volume import page_volume
from texgs.viewer.standalone import joined_modules
from texgs.volume.nrrd_file import open_grid
from texgs.volume.slices import place_at, planes_of, point_of, slice_colors, slice_of
from texgs.volume.space import LPS, RAS, Space

READ = """
Object.assign(globalThis, modules["samples.js"], modules["tensors.js"]);
"""
START = """
const { PageSlices } = modules["page_slices.js"];
globalThis.open = async (volume, scene) => {
  const samples = samplesOf((await unpack(volume)).tensors, scene.volume.channels.length);
  globalThis.slices = new PageSlices(samples, { original: scene, scene });
};
globalThis.pixels = (plane, number, window) =>
  btoa(String.fromCharCode(...slices.slice(slices.planes[plane], number, window).data));
"""
TURNED = [[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]]
SPACES = [Space(), Space.along(np.eye(3), LPS, "mm"), Space.along(np.array(TURNED), RAS, "mm")]
IMAGE = image_on(nested(), waves(nested().values.shape).values)
WINDOW = (40.0, 200.0)


@pytest.fixture
def opened(chromium):
    """Slices of scenes in a page without anything else."""
    page, errors = chromium.new_page(), []
    page.on("pageerror", lambda error: errors.append(str(error)))
    scripts = joined_modules("webgl.js") + READ, joined_modules("page_slices.js") + START
    tags = "".join(f"<script type=module>{each}</script>" for each in scripts)
    page.set_content(f"<!doctype html><body>{tags}")
    page.wait_for_function("globalThis.pixels !== undefined")

    def open_slices(scene, budget=100.0):
        volume = page_volume(scene, budget)
        facts = {"volume": volume.describe(scene), "slices": volume.slices(scene)}
        described = describe("test", scene, scene.open()) | facts
        page.evaluate("words => open(...words)", [b64encode(volume.packed).decode(), described])
        return page, volume

    yield open_slices
    assert errors == []


def picture(page, planes, plane, number):
    """Pixels [H, W, 3] of a slice in the page."""
    text = page.evaluate("words => pixels(...words)", [plane, number, WINDOW])
    return np.frombuffer(b64decode(text), np.uint8).reshape(*planes[plane].size[::-1], 4)[..., :3]


@pytest.mark.parametrize("space", SPACES)
@pytest.mark.parametrize("image", [None, IMAGE])
def test_they_are_those_of_texgs_where_the_page_has_all_samples(opened, tmp_path, space, image):
    scene = scene_of_labels(tmp_path, image, space=space)
    grid, labels = open_grid(scene.volume.file), Twin(scene).labels(scene, scene.open().palettes)
    (page, volume), planes = opened(scene), planes_of(grid)
    assert volume.codes.shape[1:] == grid.values.shape[1:]
    for number, plane in enumerate(planes):
        for each in (0, plane.count // 2 + 1):
            expected = slice_colors(partial(slice_of, grid, plane, each), WINDOW, labels)
            assert np.abs(picture(page, planes, number, each).astype(int) - expected).max() <= 1
    for index in ((20, 21, 23), (3, 30, 11), (24, 19, 26)):
        index = tuple(min(each, plane.count - 1) for each, plane in zip(index, planes, strict=True))
        point = point_of(grid, index)
        place, got = place_at(grid, point, labels), page.evaluate("point => slices.place(point)", point)
        assert (tuple(got["index"]), tuple(got["labels"])) == (index, place.labels)
        assert np.allclose(got["position"], place.position)
        assert (got["value"], place.value is None) == (place.value, image is None)
    assert "on 48 × 40 × 44 samples." in page.evaluate("slices.words")


def test_they_have_the_nearest_samples_of_fewer_and_say_so(opened, tmp_path):
    scene = scene_of_labels(tmp_path, IMAGE)
    (page, volume), planes = opened(scene, 0.01), planes_of(open_grid(scene.volume.file))
    codes = np.split(volume.codes, 4)[0]
    (z, y, x), (low, high) = codes.shape, volume.ends[0]
    assert x < 48
    nearest = [
        np.rint(np.arange(n) * ((m - 1) / (n - 1))).astype(int) for n, m in ((44, z), (40, y), (48, x))
    ]
    values = (low + codes / 255.0 * (high - low))[np.ix_(*nearest)]
    plane = planes[2]
    grey = values[10, ::-1] if plane.up[1] > 0 else values[10]
    expected = np.rint(255 * ((grey - WINDOW[0]) / (WINDOW[1] - WINDOW[0])).clip(0, 1))
    got = picture(page, planes, 2, 10)
    is_grey = (got == got[..., :1]).all(axis=-1)
    assert is_grey.mean() > 0.3
    assert np.abs(got[..., 0] - expected)[is_grey].max() <= 1
    words = page.evaluate("slices.words")
    assert words == f"In this page: values to the nearest {volume.step}, on {x} × {y} × {z} samples."


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    folder = tmp_path_factory.mktemp("slices")
    scene = scene_of_labels(folder, IMAGE, space=SPACES[1])
    known = replace(scene, space=open_grid(scene.volume.file).world)
    return write_scene(folder / "scene.yaml", known)


@pytest.mark.parametrize("width", [1400, 400])
def test_a_page_shows_slices_beside_its_scene_and_in_it(chromium, source, tmp_path, width):
    with standalone(chromium, source, "--volume") as page:
        page.set_viewport_size({"width": width, "height": 900})
        assert page.get_by_role("heading", name="Transfer functions").count() == 0
        page.get_by_role("button", name="Slices", exact=True).click()
        said = page.locator("#slices [role=status]")
        expect(said).to_contain_text("24, 20, 22 · L", timeout=WAIT)
        expect(said).to_contain_text("ball 3")
        assert page.locator("#slices canvas").count() == 3
        before = shown(page)
        page.get_by_label("Sagittal slice, as a number").fill("1")
        expect(said).to_contain_text("1, 20, 22 · L")
        expect(said).not_to_contain_text("ball")
        box = page.locator("#picture").bounding_box()
        page.locator("#picture").click(position={"x": box["width"] / 2, "y": box["height"] / 2})
        expect(said).not_to_contain_text("1, 20, 22 ·")
        page.get_by_label("In the scene").check()
        settle(page)
        assert np.abs(shown(page) - before).mean() > 1, "a slice in the scene"
        words = page.locator("#words textarea").input_value()
        assert "cut.faces=slice" in words
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        page.screenshot(path=tmp_path / "page.png")
