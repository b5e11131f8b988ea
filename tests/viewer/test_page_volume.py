"""The volume that a page carries: what is left of it, and what a browser draws of it."""

import io
import json
import zlib
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image
from safetensors.numpy import load
from scipy.ndimage import map_coordinates

from tests.viewer.drawing import closeness
from tests.viewer.drawn_scenes import scene_of_volume, waves
from texgs.cli.main import main
from texgs.core.errors import ArgumentError
from texgs.scene.scene_file import read_scene, write_scene
from texgs.viewer.downloads import Downloads, exports_of
from texgs.viewer.messages import Export, parse
from texgs.viewer.page_volume import LEVELS, PageVolume, within
from texgs.volume.grid import Grid

PLACE = {"azimuth": 20, "polar": 10, "distance": 4, "target": [0, 0, 0], "fov_y": 30}
VIEW = parse(json.dumps({"type": "view", "camera": {**PLACE, "width": 96, "height": 80}}))


# ---- What is left of a volume -----------------------------------------------


def values_of(volume: PageVolume):
    """Values that codes stand for."""
    return volume.low + volume.codes.astype(float) * (volume.high - volume.low) / LEVELS


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
    assert (volume.low, volume.high) == (grid.values.min(), grid.values.max())
    step = volume.step * (volume.high - volume.low) / LEVELS
    error = np.abs(values_of(volume) - resampled(grid.values, volume.codes.shape)).max()
    assert error <= 0.5 * step + 1e-4 * (volume.high - volume.low)


def test_a_volume_that_fits_stays_as_it_is():
    values = np.random.default_rng(1).integers(0, 256, (9, 8, 7)).astype(np.uint8)
    values[0, 0, :2] = 0, 255
    volume = within(Grid(values), 10_000)
    assert np.array_equal(volume.codes, values)


@pytest.mark.parametrize(
    ("value", "words"), [(7.0, "got 7 to 7"), (np.nan, "got nan to nan"), (np.inf, "got inf to inf")]
)
def test_volumes_that_were_not_prepared_are_refused(value, words):
    with pytest.raises(ArgumentError, match=f"expected finite samples of two values at least, {words}"):
        within(Grid(np.full((3, 3, 3), value)), 10_000)


def test_packed_codes_are_sums_along_all_axes():
    volume = within(waves(), 10_000)
    steps = load(zlib.decompress(volume.packed))["steps"]
    for axis in range(3):
        steps = np.cumsum(steps, axis=axis, dtype=np.uint8)
    assert np.array_equal(steps, volume.codes)


def test_no_room_is_a_sentence():
    with pytest.raises(ArgumentError, match="expected room for at least 2 samples a side, got 20 bytes"):
        within(waves(), 20)


# ---- The whole page ---------------------------------------------------------


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    """A scene file with a volume, as the workflow makes it."""
    folder = tmp_path_factory.mktemp("whole")
    return write_scene(folder / "scene.yaml", scene_of_volume(folder, waves()))


def test_the_page_works_alone(chromium, source, capsys):
    """Its editor shows a new function, which can be undone and copied; nothing is loaded."""
    file = source.with_name("scene.html")
    assert main(["export", str(source), "--to", str(file), "--volume"]) == 0
    assert "34 x 26 x 30 samples in steps of" in capsys.readouterr().err
    page, wrong, asked = chromium.new_page(viewport={"width": 900, "height": 500}), [], []
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("console", lambda message: wrong.append(message.text) if message.type == "error" else None)
    page.on("request", lambda request: asked.append(request.url))
    page.goto(file.as_uri())
    page.wait_for_selector("#picture:not([hidden])")
    page.select_option("#mode", "volume")
    page.locator("#models input[type=checkbox]").first.uncheck()  # it hides the middle
    before = settled(page)
    page.get_by_role("button", name="New", exact=True).click()
    after = settled(page)
    assert closeness(before, after) < 40, "a new function is seen"
    words = page.locator("#functions textarea").input_value()
    assert list(json.loads(words.removeprefix("functions: "))) == ["TF03"]
    undo = page.get_by_role("button", name="Undo")
    assert "functions TF03" in undo.get_attribute("title")
    undo.click()
    assert np.array_equal(settled(page), before)
    assert page.locator("#functions").is_hidden()
    assert page.get_by_role("button", name="Make model").is_hidden(), "there is no server"
    page.select_option("#mode", "difference")
    assert page.locator("#gain-row").is_visible()
    assert not np.array_equal(settled(page), before)
    page.close()
    assert wrong == []
    assert [url for url in asked if not url.startswith("data:")] == [file.as_uri()]


def settled(page):
    """The picture on the screen once a whole frame is there."""
    page.wait_for_timeout(400)
    page.wait_for_selector("#picture[aria-busy=false]")
    picture = Image.open(io.BytesIO(page.locator("#picture").screenshot())).convert("RGB")
    return np.asarray(picture).astype(int)


def test_the_viewer_exports_it_too(source, tmp_path):
    scene = read_scene(source)
    assert "volume" in exports_of(scene)
    assert "volume" not in exports_of(replace(scene, volume=None))
    downloads = Downloads(None, SimpleNamespace(checked=lambda scene: ""), tmp_path / "files")
    written = downloads.write(scene, Export("volume", VIEW), "scene")[0].read_text()
    assert 'id="volume"' in written
    assert 'id="volume"' not in downloads.write(scene, Export("html", VIEW), "scene")[0].read_text()


def test_the_same_scene_gives_the_same_bytes(source, tmp_path):
    files = [tmp_path / name / "page.html" for name in ("a", "b")]
    for file in files:
        file.parent.mkdir()
        assert main(["export", str(source), "--to", str(file), "--volume", "0.05"]) == 0
    assert files[0].read_bytes() == files[1].read_bytes()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--to", "x.html", "--volume", "nan"], "--volume: expected a finite number, got nan"),
        (["--to", "x.html", "--volume", "1e-5"], "expected room for at least 2 samples a side, got 10 bytes"),
    ],
)
def test_mistakes_are_sentences(source, tmp_path, monkeypatch, capsys, words, message):
    monkeypatch.chdir(tmp_path)
    assert main(["export", str(source), *words]) == 2
    assert message in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_a_scene_without_its_volume_is_refused(source, tmp_path, capsys):
    scene = write_scene(tmp_path / "bare.yaml", replace(read_scene(source), volume=None))
    assert main(["export", str(scene), "--to", str(tmp_path / "x.html"), "--volume"]) == 2
    assert "volume: expected the volume that the scene was made from, got none" in capsys.readouterr().err
