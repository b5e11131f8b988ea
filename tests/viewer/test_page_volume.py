"""The volume that a page carries: what is left of it, and what a browser draws of it."""

import json
import zlib
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from safetensors.numpy import load
from scipy.ndimage import map_coordinates

from tests.refusals import refused
from tests.viewer.drawing import closeness
from tests.viewer.drawn_scenes import scene_of_volume, waves
from tests.viewer.in_browser import shown, standalone
from texgs.scene.scene_file import read_scene, write_scene
from texgs.viewer.downloads import exports_of, write_download
from texgs.viewer.messages import Export, parse
from texgs.viewer.page_volume import LEVELS, PageVolume, within
from texgs.volume.grid import Grid

PLACE = {"azimuth": 20, "polar": 10, "distance": 4, "target": [0, 0, 0], "fov_y": 30}
VIEW = parse(json.dumps({"type": "view", "camera": {**PLACE, "width": 96, "height": 80}}))


# ---- What is left of a volume -----------------------------------------------


def values_of(volume: PageVolume):
    """Values that codes stand for."""
    ((low, high),) = volume.ends
    return low + volume.codes.astype(float) * (high - low) / LEVELS


def resampled(values, shape):
    """Trilinear values on a lattice between the same corners, by another program."""
    places = np.meshgrid(
        *(np.linspace(0, a - 1, b) for a, b in zip(values.shape, shape, strict=True)), indexing="ij"
    )
    return map_coordinates(values.astype(float), places, order=1)


@settings(deadline=None, max_examples=25)
@given(
    st.tuples(*[st.integers(2, 14)] * 3),
    st.sampled_from(["uint8", "int16", "float32"]),
    st.integers(300, 6000),
    st.integers(0, 99),
)
def test_codes_are_the_trilinear_values_within_the_bytes_allowed(shape, kind, most, seed):
    made = np.random.default_rng(seed).normal(100, 20, shape)
    grid = Grid(made.astype(kind))
    volume = within(grid, most)
    assert len(volume.packed) <= most
    assert volume.ends == [(grid.values.min(), grid.values.max())]
    step = volume.step * np.ptp(volume.ends) / LEVELS
    error = np.abs(values_of(volume) - resampled(grid.values, volume.codes.shape)).max()
    assert error <= 0.5 * step + 1e-4 * np.ptp(volume.ends)


def test_channels_have_one_lattice_and_a_range_each():
    image, *masks = (np.random.default_rng(seed).normal(100, 20, (9, 10, 11)) for seed in range(3))
    masks = [np.uint8(mask > 100) * np.uint8(255) for mask in masks]
    grid = Grid(image.astype(np.float32), others=tuple(masks))
    for most, is_whole in ((10_000, True), (700, False)):
        volume = within(grid, most)
        assert len(volume.packed) <= most
        assert volume.ends == [(grid.values.min(), grid.values.max()), (0, 255), (0, 255)]
        z, y, x = volume.codes.shape
        assert ((z // 3, y, x) == image.shape) is is_whole
        assert "of 3 channels, " in str(volume)
        for values, codes, ends in zip((image, *masks), np.split(volume.codes, 3), volume.ends, strict=True):
            known = ends[0] + codes * (np.ptp(ends) / LEVELS)
            error = np.abs(known - resampled(values, codes.shape)).max()
            assert error <= (0.5 * volume.step / LEVELS + 1e-4) * np.ptp(ends)


def test_a_volume_that_fits_stays_as_it_is():
    values = np.random.default_rng(1).integers(0, 256, (9, 8, 7)).astype(np.uint8)
    values[0, 0, :2] = 0, 255
    volume = within(Grid(values), 10_000)
    assert np.array_equal(volume.codes, values)


@pytest.mark.parametrize(
    ("grid", "most", "named"),
    [
        *((Grid(np.full((3, 3, 3), x)), 10_000, f"got {x:g} to {x:g}") for x in (7.0, np.nan, np.inf)),
        (waves(), 20, "expected room for at least 2 samples a side, got 20 bytes"),
    ],
)
def test_volumes_that_no_page_can_hold_are_refused(grid, most, named):
    refused(lambda: within(grid, most), named)


def test_packed_codes_are_sums_along_all_axes():
    volume = within(waves(), 10_000)
    steps = load(zlib.decompress(volume.packed))["steps"]
    for axis in range(3):
        steps = np.cumsum(steps, axis=axis, dtype=np.uint8)
    assert np.array_equal(steps, volume.codes)
    assert within(waves(), 10_000).packed == volume.packed, "the same bytes"


# ---- The whole page ---------------------------------------------------------


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    """A scene file with a volume, as the workflow makes it."""
    folder = tmp_path_factory.mktemp("whole")
    return write_scene(folder / "scene.yaml", scene_of_volume(folder, waves()))


def test_the_page_works_alone(chromium, source, capsys):
    """Its editor shows a new function, which can be undone and copied; nothing is loaded."""
    with standalone(chromium, source, "--volume") as page:
        assert "34 x 26 x 30 samples in steps of" in capsys.readouterr().err
        page.select_option("#mode", "volume")
        page.locator("#models input[type=checkbox]").first.uncheck()  # it hides the middle
        before = shown(page)
        page.get_by_role("button", name="New", exact=True).click()
        assert closeness(before, shown(page)) < 40, "a new function is seen"
        words = page.locator("#functions textarea").input_value()
        assert list(json.loads(words.removeprefix("functions: "))) == ["TF03"]
        undo = page.get_by_role("button", name="Undo")
        assert "functions TF03" in undo.get_attribute("title")
        undo.click()
        assert np.array_equal(shown(page), before)
        assert page.locator("#functions").is_hidden()
        assert page.get_by_role("button", name="Make model").is_hidden(), "there is no server"
        page.select_option("#mode", "difference")
        assert page.locator("#gain-row").is_visible()
        assert not np.array_equal(shown(page), before)


def test_the_viewer_exports_it_too(source, tmp_path):
    scene = read_scene(source)
    assert "volume" in exports_of(scene)
    assert "volume" not in exports_of(replace(scene, volume=None))
    for kind in ("volume", "html"):
        written, _ = write_download(tmp_path, scene, Export(kind, VIEW), "page", "Page", "", None)
        assert ('id="volume"' in written.read_text()) is (kind == "volume")
