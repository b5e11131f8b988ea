"""The renderer of the HTML export against the rasterizer, for the same numbers, in a real browser."""

import copy
from dataclasses import asdict
from typing import get_args

import numpy as np
import pytest

from tests.fields.surfels.test_composition import ball
from tests.viewer.drawing import drawn, open_renderer, rendered
from texgs.core.camera import orbit
from texgs.core.cuts import Box, Cuts, Plane
from texgs.core.errors import ArgumentError
from texgs.core.light import HEADLIGHT, Light
from texgs.fields.part_edit import PartEdit
from texgs.fields.surfels.model_file import write_model
from texgs.scene.scene import Scene, SceneModel, SceneSegment
from texgs.scene.segment_file import write_segment
from texgs.scene.shot import Mode
from texgs.viewer.description import describe
from texgs.viewer.standalone import pack

CAMERAS = [
    orbit(30, 20, 3, 40, 96, 64),
    orbit(-110, 75, 2, 50, 64, 96),
    orbit(200, -35, 5, 20, 80, 80),
    orbit(85, 0, 0.9, 60, 64, 48),
    orbit(0, 90, 2.5, 30, 33, 47),
]
SIDE = Light("directional", 100, 30)
MODES = [mode for mode in get_args(Mode) if mode != "volume"]  # a page has none
LEVELS = 3  # of 255: a pixel of the rasterizer ends where 1e-4 of the light is left, ours does not


def scene_of(folder, **first):
    """Two textured models, the first with two segments that overlap, and one without texture."""
    own = ball(1, n=400, shared=False)
    models = {"A": own, "B": ball(2, n=200, middle=0.2), "C": ball(3, n=60, stage="shading")}
    files = {name: write_model(folder / f"{name}.safetensors", model) for name, model in models.items()}
    above, right = own.parameters["means"][:, 1] > 0.1, own.parameters["means"][:, 0] > 0.2
    segments = {
        name: SceneSegment(write_segment(folder / f"{name}.segment", own, mask, {}), edit)
        for name, mask, edit in (
            ("above", above, PartEdit(palette=(0.1, 0.6, 0.2))),
            ("right", right, PartEdit(opacity=0.4, specular=3.0)),
        )
    }
    entries = {name: SceneModel(file) for name, file in files.items()}
    entries["A"] = SceneModel(files["A"], segments=segments)
    return Scene(entries, **first)


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return scene_of(tmp_path_factory.mktemp("scene"))


@pytest.fixture(scope="module")
def packed(scene, tmp_path_factory):
    return pack(scene.open())


@pytest.fixture(scope="module")
def description(scene):
    composed = scene.open()
    return describe("test", scene, composed)


@pytest.fixture(scope="module")
def page(chromium, packed, description):
    page = chromium.new_page()
    errors = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.on("console", lambda message: errors.append(message.text) if message.type == "error" else None)
    open_renderer(page, packed, description)
    yield page
    assert errors == []


def difference(page, packed, description, scene, camera, mode="shaded", *, light=HEADLIGHT, edits=None):
    """Largest difference of two pictures, levels of 255."""
    edits = scene.edits if edits is None else edits
    shown = copy.deepcopy(description)
    shown["light"] = None if light is HEADLIGHT else {"azimuth": light.azimuth, "polar": light.polar}
    parts = [part for model in shown["models"] for part in (model, *model["segments"])]
    for part, edit in zip(parts, edits, strict=True):
        part["edit"] = {**vars(edit)}
    expected = rendered(packed, camera, light, edits, scene.background, mode)
    pixels = drawn(page, camera, shown, mode)
    assert expected.std() > 5  # something is seen
    return int(np.abs(expected.astype(int) - pixels.astype(int)).max())


@pytest.mark.parametrize("mode", ["shaded", "depth", "discs"])
@pytest.mark.parametrize("camera", CAMERAS)
def test_cuts_are_those_of_the_rasterizer(page, packed, description, scene, camera, mode):
    cuts = Cuts([Plane([1.0, 2.0, 0.5], 0.2), Plane([0.0, 0.0, -1.0], 0.3)], Box([-0.6] * 3, [0.5] * 3))
    shown = copy.deepcopy(description) | {"cuts": asdict(cuts)}
    expected = rendered(packed, camera, HEADLIGHT, scene.edits, scene.background, mode, cuts)
    whole = rendered(packed, camera, HEADLIGHT, scene.edits, scene.background, mode)
    assert not np.array_equal(expected, whole)
    error = np.abs(expected.astype(int) - drawn(page, camera, shown, mode).astype(int)).max(axis=2)
    assert (error > LEVELS).mean() < 0.002, "fragments on a plane but for rounding"


@pytest.mark.parametrize("light", [HEADLIGHT, SIDE, Light("directional", -60, -50)])
@pytest.mark.parametrize("camera", CAMERAS)
def test_views_and_lights_are_those_of_the_rasterizer(page, packed, description, scene, camera, light):
    assert difference(page, packed, description, scene, camera, light=light) <= LEVELS


@pytest.mark.parametrize("mode", MODES)
def test_modes_are_those_of_the_rasterizer(page, packed, description, scene, mode):
    assert difference(page, packed, description, scene, CAMERAS[0], mode, light=SIDE) <= LEVELS


EDITS = {
    "hidden": (PartEdit(), {"visible": False}),
    "faint": (PartEdit(opacity=0.15), {}),
    "opaque": (PartEdit(opacity=20.0), {}),
    "recoloured": (PartEdit(palette=(0.9, 0.1, 0.3)), {}),
    "tinted": (PartEdit(specular=4.0, shininess=0.2, tint=(1.0, 0.7, 0.2)), {"tint": (0.2, 0.4, 1.0)}),
    "material": (PartEdit(ambient=0.3, diffuse=1.7, specular=4.0, shininess=0.2), {}),
}


@pytest.mark.parametrize("edit", EDITS)
def test_edits_are_those_of_the_rasterizer(page, packed, description, scene, edit):
    first, other = EDITS[edit]
    edits = [first, *scene.edits[1:3], PartEdit(**other), PartEdit()]
    assert difference(page, packed, description, scene, CAMERAS[1], light=SIDE, edits=edits) <= LEVELS


def test_depths_of_what_is_faint_everywhere(page, packed, description, scene):
    """No pixel says where the nearest and the farthest point is."""
    edits = [PartEdit(opacity=0.02)] * 5
    assert difference(page, packed, description, scene, CAMERAS[0], "depth", edits=edits) <= 1


def test_faint_scenes_that_no_pixel_ends_early_in_agree_within_a_level(page, packed, description, scene):
    edits = [PartEdit(opacity=0.1)] * 5
    edits[3] = PartEdit(opacity=0.1, palette=(0.2, 0.2, 0.9))
    worst = max(
        difference(page, packed, description, scene, camera, light=light, edits=edits)
        for camera in CAMERAS
        for light in (HEADLIGHT, SIDE)
    )
    assert worst <= 1


def test_the_background_is_that_of_the_scene(page, description):
    shown = copy.deepcopy(description) | {"background": [0.2, 0.4, 0.6]}
    for model in shown["models"]:
        for part in (model, *model["segments"]):
            part["edit"]["visible"] = False
    assert (drawn(page, CAMERAS[0], shown) == [51, 102, 153]).all()
    assert (drawn(page, CAMERAS[0], shown, "alpha") == 0).all()


def test_surfels_are_sorted_again_where_their_order_may_be_another(page, description):
    page.evaluate(
        "() => { const order = renderer._order, sort = order.farToNear; globalThis.sorted = 0;"
        " order.farToNear = () => { sorted += 1; return sort.call(order); }; }"
    )
    shown = copy.deepcopy(description)
    edit = shown["models"][1]["edit"]
    counts = []
    for camera, changed in (
        (CAMERAS[0], {}),
        (CAMERAS[0], {"opacity": 0.5, "palette": [1, 0, 0]}),
        (CAMERAS[0], {"visible": False}),
        (CAMERAS[1], {}),
        (CAMERAS[1], {"opacity": 0.2}),
    ):
        edit |= changed
        drawn(page, camera, shown)
        counts.append(page.evaluate("sorted"))
    page.evaluate("() => { delete renderer._order.farToNear; }")
    assert np.diff([0, *counts]).tolist() == [1, 0, 1, 1, 0]


@pytest.mark.parametrize("count", [0, 1, 7, 5000])
def test_depths_are_sorted_exactly_and_ties_as_the_rasterizer_has_them(page, count):
    depths = np.random.default_rng(count).exponential(size=count).astype(np.float32)
    depths[::3] = depths[: len(depths[::3])].round(1) + np.float32(0.2)  # many are the same
    order = page.evaluate(
        "depths => { const order = new DepthOrder(depths.length); depths.forEach((z, i) => order.add(i, z));"
        " return [...order.farToNear()]; }",
        depths.tolist(),
    )
    assert order == np.argsort(depths, kind="stable")[::-1].tolist()


def test_half_precision_is_read_exactly(page):
    halves = np.arange(2**16, dtype=np.uint16).view(np.float16)
    finite = np.isfinite(halves)
    values = page.evaluate("bits => bits.map(halfToFloat)", np.flatnonzero(finite).tolist())
    assert np.array_equal(np.array(values, np.float32), halves[finite].astype(np.float32))


def test_texels_beyond_eight_bits_have_sixteen(chromium, tmp_path):
    model = ball(5)
    model.parameters["texels"][::2] += 1.5
    scene = Scene({"A": SceneModel(write_model(tmp_path / "a.safetensors", model), PartEdit(ambient=0.2))})
    composed = scene.open()
    packed = pack(composed)
    description = describe("bright", scene, composed)
    page = chromium.new_page()
    open_renderer(page, packed, description)
    assert difference(page, packed, description, scene, CAMERAS[0]) <= LEVELS


WITHOUT_FLOAT_BLEND = """() => {
  const known = WebGL2RenderingContext.prototype.getExtension;
  WebGL2RenderingContext.prototype.getExtension = function (name) {
    return name === "EXT_float_blend" ? null : known.call(this, name);
  };
}"""


def test_half_precision_is_used_where_floats_cannot_be_blended(chromium, packed, description, scene):
    page = chromium.new_page()
    page.evaluate(WITHOUT_FLOAT_BLEND)
    open_renderer(page, packed, description)
    assert page.evaluate("renderer._pass.target.format[0] === WebGL2RenderingContext.RGBA16F")
    for camera in CAMERAS:
        assert difference(page, packed, description, scene, camera, light=SIDE) <= LEVELS
    faint = [PartEdit(opacity=0.1)] * 5
    assert difference(page, packed, description, scene, CAMERAS[0], edits=faint) <= 1


def test_texels_that_no_page_can_hold_are_refused(tmp_path):
    model = ball(5)
    model.parameters["texels"][3, 1] = 300
    scene = Scene({"A": SceneModel(write_model(tmp_path / "a.safetensors", model))})
    with pytest.raises(ArgumentError, match=r"^texels: expected at most 255.992, got 300; fit"):
        pack(scene.open())
