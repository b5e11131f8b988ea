"""The volume that a page carries: what is left of it, and what a browser draws of it."""

import io
import json
import zlib
from base64 import b64encode
from dataclasses import asdict, replace
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image
from safetensors.numpy import load
from scipy.ndimage import map_coordinates

from tests.fields.surfels.test_composition import ball
from tests.scene.balls import ball_models
from tests.scene.test_twin import HIGH, LOOK, LOW
from tests.viewer.drawing import drawn, open_renderer, view_of
from texgs.cli.main import main
from texgs.core.camera import orbit
from texgs.core.cuts import Box, Cuts, Plane
from texgs.core.errors import ArgumentError
from texgs.core.io import write_json
from texgs.core.light import HEADLIGHT, Light
from texgs.fields.part_edit import PartEdit
from texgs.fields.surfels.variants import write_texture
from texgs.scene.cut_view import beside
from texgs.scene.frame import frame
from texgs.scene.scene import Scene, SceneVolume
from texgs.scene.scene_file import read_scene, write_scene
from texgs.scene.twin import Twin, range_of
from texgs.viewer.description import describe
from texgs.viewer.downloads import Downloads, exports_of
from texgs.viewer.frames import shown as shown_beside
from texgs.viewer.messages import Export, parse
from texgs.viewer.page_volume import LEVELS, PageVolume, page_volume, within
from texgs.viewer.standalone import pack
from texgs.volume.generate import sphere
from texgs.volume.grid import Grid
from texgs.volume.nrrd_file import open_grid
from texgs.volume.prepare import prepare
from texgs.volume.slabs import ArraySource
from texgs.volume.transfer import TransferFunction, combine

CAMERA = orbit(20, 10, 4, 30, 96, 80)
FROM_BELOW = orbit(-130, -40, 2.5, 40, 64, 90)
SIDE = Light("directional", 100, 30)
CUTS = Cuts([Plane([1.0, 0.2, 0.0], 0.1), Plane([0.0, 1.0, 0.3], 0.2)])
PLACE = {"azimuth": 20, "polar": 10, "distance": 4, "target": [0, 0, 0], "fov_y": 30}
VIEW = parse(json.dumps({"type": "view", "camera": {**PLACE, "width": 96, "height": 80}}))
LEAST = 38.0  # dB; samples are codes of 8 bits, and steps are longer than those of the caster
WIDE = TransferFunction(((0.1, 0), (0.2, 0.3), (0.9, 0.1)), ((0.1, 0.9, 0.2, 0.1), (0.9, 0.1, 0.9, 0.4)))


def volume_of(folder, grid):
    """A prepared volume with two basic TFs, which are given on the range of its values."""
    write_json(folder / "volume.json", asdict(prepare(ArraySource(grid, "made"), folder / "volume.nrrd")))
    tfs = {"low": LOW.scaled(*ends_of(grid)), "high": HIGH.scaled(*ends_of(grid))}
    return SceneVolume(folder / "volume.nrrd", tfs, LOOK)


def ends_of(grid):
    return float(grid.values.min()), float(grid.values.max())


def waves(shape=(30, 26, 34), spacing=(1.0, 1.5, 0.7)):
    """A lumpy body on a lattice with different spacings."""
    z, y, x = np.meshgrid(*(np.linspace(-1, 1, size) for size in shape), indexing="ij")
    values = np.exp(-2 * (x**2 + y**2 + z**2)) + 0.1 * np.sin(5 * x) * np.cos(4 * y) * np.cos(6 * z)
    return Grid(values.astype(np.float32), spacing, (3.0, -2.0, 10.0))


@pytest.fixture(scope="module", params=["sphere", "waves", "flat"])
def scene(request, tmp_path_factory):
    """Two balls of surfels beside a volume that they have little to do with."""
    folder = tmp_path_factory.mktemp(request.param)
    grids = {
        "sphere": sphere(40),
        "waves": waves(),
        "flat": waves((24, 2, 20), (1, 3, 1)),
    }
    models = ball_models(folder, "low", "high")
    return Scene(models, volume=volume_of(folder, grids[request.param]))


@pytest.fixture(scope="module")
def page(chromium, scene):
    """A browser that draws the scene with its volume; nothing may go wrong in it."""
    page, errors = chromium.new_page(), []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.on("console", lambda message: errors.append(message.text) if message.type == "error" else None)
    open_in(page, scene)
    yield page
    page.close()
    assert errors == []


def open_in(page, scene):
    composed, volume = scene.open(), page_volume(scene, 100)
    page.description = describe("test", scene, composed) | {"volume": volume.describe(scene)}
    packed = pack(composed)
    open_renderer(page, packed, page.description, b64encode(volume.packed).decode())


def described(page, scene):
    """The description of another scene of the same models."""
    composed, volume = scene.open(), page.description["volume"]
    return describe("test", scene, composed) | {"volume": {**volume, "looks": scene.has_looks}}


def closeness(one, other):
    """PSNR of two pictures, dB."""
    return -10 * np.log10(max(np.mean((one / 255.0 - other / 255.0) ** 2), 1e-9))


def compare(page, scene, camera=CAMERA, mode="volume"):
    """PSNR of what a page shows and the frame of `texgs render`."""
    expected = frame(scene.open(), camera, scene, mode, Twin(scene))
    assert expected.std() > 5, "something is seen"
    return closeness(drawn(page, camera, described(page, scene), mode), expected)


@pytest.mark.parametrize("light", [HEADLIGHT, SIDE], ids=["headlight", "side"])
@pytest.mark.parametrize("camera", [CAMERA, FROM_BELOW], ids=["above", "below"])
def test_the_volume_is_that_of_the_caster(page, scene, camera, light):
    assert compare(page, replace(scene, light=light), camera) > LEAST


@pytest.mark.parametrize(
    "edit",
    [
        {"visible": False},
        {"opacity": 0.3},
        {"opacity": 5.0, "palette": (0.1, 0.8, 0.2)},
        {"ambient": 0.2, "diffuse": 1.5, "specular": 3.0, "shininess": 0.3},
        {"specular": 3.0, "shininess": 0.3, "tint": (1.0, 0.5, 0.1)},
    ],
    ids=lambda edit: next(iter(edit)),
)
def test_edits_are_those_of_the_twin(page, scene, edit):
    models = {**scene.models, "low": replace(scene.models["low"], edit=PartEdit(**edit))}
    assert compare(page, replace(scene, models=models)) > LEAST


def test_functions_take_the_place_of_basic_ones_and_may_overlap(page, scene):
    ends = ends_of(open_grid(scene.volume.file))
    tried = replace(scene, functions={"high": WIDE.scaled(*ends), "new": HIGH.scaled(*ends)})
    assert compare(page, tried) > LEAST
    fitted, same = (drawn(page, CAMERA, described(page, each), "shaded") for each in (scene, tried))
    assert np.array_equal(fitted, same), "no model was made of them"


@pytest.mark.parametrize("faces", ["shaded", "unlit"])
def test_cuts_without_looks_are_those_of_the_twin(page, scene, faces):
    for cuts in (replace(CUTS, faces=faces), Cuts(box=Box([-0.3, -0.4, -0.2], [0.2, 0.3, 0.4]), faces=faces)):
        for mode in ("volume", "shaded"):
            assert compare(page, replace(scene, cuts=cuts, light=SIDE), mode=mode) > LEAST - 3


def test_cuts_leave_materials_that_differ(page, scene):
    """A volume has one: models with others are seen below faces, as in `texgs render`."""
    name, entry = next(iter(scene.models.items()))
    edited = replace(entry, edit=PartEdit(ambient=0.2, diffuse=0.1))
    cut = replace(scene, models={**scene.models, name: edited}, cuts=CUTS, light=SIDE)
    of_volume = frame(cut.open(), CAMERA, cut, "volume", Twin(cut))
    assert closeness(of_volume, frame(cut.open(), CAMERA, cut, "shaded", Twin(cut))) < 35
    assert compare(page, cut, mode="shaded") > 40


def test_cuts_with_looks_have_faces_of_the_volume_over_the_models(page, scene, tmp_path):
    texture = write_texture(tmp_path / "look.safetensors", ball(1))
    models = {**scene.models, "low": replace(scene.models["low"], texture=texture)}
    styled = replace(scene, models=models, cuts=CUTS)
    page.evaluate("() => { renderer._original.volume.looks = true; renderer._upload(); }")
    got = compare(page, styled, mode="shaded")
    page.evaluate("() => { renderer._original.volume.looks = false; renderer._upload(); }")
    hollow = replace(styled, volume=None)
    bare = frame(hollow.open(), CAMERA, hollow)
    faces = frame(styled.open(), CAMERA, styled, twin=Twin(styled))
    assert got > max(32.0, closeness(bare, faces) + 3), "rims have a quarter of the resolution, and 8 bits"


@pytest.mark.parametrize("mode", ["difference", "wipe"])
def test_scene_and_volume_beside_each_other(page, scene, mode):
    image, truth = beside(scene.open(), CAMERA, scene, Twin(scene))
    expected = shown_beside(replace(VIEW, mode=mode, gain=4.0, wipe=0.4), image.color, truth.color)
    got = drawn(page, CAMERA, described(page, scene), mode, gain=4, wipe=0.4)
    assert closeness(got, expected) > LEAST - 12 * (mode == "difference"), "differences are enlarged"


DEPTH = """([camera, scene, mode, pixel]) => {
  const view = { ...camera, viewmat: () => camera.viewmat, unproject: (place, depth) => depth };
  renderer.size = () => [camera.width, camera.height];
  return renderer.pointAt(view, scene, { mode }, pixel);
}"""


def test_depths_of_the_volume_are_those_of_the_caster(page, scene):
    """A double click turns around what the mode shows: the volume here, or the models."""
    volume = Twin(scene)._caster.cast(combine(scene.volume.tfs), CAMERA, HEADLIGHT, ("depth",))
    models = scene.open().render(CAMERA, HEADLIGHT, scene.edits, outputs=("depth",))
    row, column = divmod(int(volume.rgba[..., 3].argmax()), CAMERA.width)
    for mode, expected in (("volume", volume), ("shaded", models)):
        words = [view_of(CAMERA), described(page, scene), mode, [column, row]]
        assert page.evaluate(DEPTH, words) == pytest.approx(float(expected.depth[row, column]), abs=5e-3)
        assert page.evaluate(DEPTH, [*words[:3], [0, 0]]) is None, "the background"


def test_a_point_of_a_face_is_of_the_volume(page, scene):
    """What is behind it may be far away, or nothing."""
    cut = replace(scene, cuts=CUTS)
    seen = Twin(cut).render(CAMERA, cut, scene.open().palettes, range_of(CUTS, CAMERA), outputs=("depth",))
    face = torch.where(range_of(CUTS, CAMERA).face >= 0, seen.alpha, 0.0)
    row, column = divmod(int(face.argmax()), CAMERA.width)
    words = [view_of(CAMERA), described(page, cut), "shaded", [column, row]]
    assert page.evaluate(DEPTH, words) == pytest.approx(float(seen.depth[row, column]), abs=5e-3)


def test_moving_pictures_have_longer_steps(page, scene):
    moving = drawn(page, CAMERA, described(page, scene), "volume", moving=True)
    still = drawn(page, CAMERA, described(page, scene), "volume")
    assert 30 < closeness(moving, still) < 80


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
    models = ball_models(folder, "low", "high")
    return write_scene(folder / "scene.yaml", Scene(models, volume=volume_of(folder, waves())))


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


def test_the_viewer_exports_it_too(source):
    scene = read_scene(source)
    assert "volume" in exports_of(scene)
    assert "volume" not in exports_of(replace(scene, volume=None))
    downloads = Downloads(None, SimpleNamespace(checked=lambda scene: ""))
    written = downloads.write(scene, Export("volume", VIEW), "scene")[0].read_text()
    assert 'id="volume"' in written
    assert 'id="volume"' not in downloads.write(scene, Export("html", VIEW), "scene")[0].read_text()
    downloads.close()


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
