"""What a page draws against what texgs renders: modes, lights, edits, cuts, functions and steps in time."""

from dataclasses import replace
from functools import cache
from itertools import product
from typing import get_args

import numpy as np
import pytest
import torch

from tests.fields.surfels.test_composition import ball
from tests.refusals import refused
from tests.scene.test_twin import HIGH
from tests.viewer.drawing import Drawing, closeness, view_of
from tests.viewer.drawn_scenes import (
    BEGIN,
    COUNT,
    ends_of,
    image_on,
    nested,
    scene_of_labels,
    scene_of_parts,
    scene_of_series,
    scene_of_volume,
    waves,
)
from texgs.core.camera import orbit
from texgs.core.cuts import NO_CUTS, Box, Cuts, Plane
from texgs.core.light import HEADLIGHT, Light
from texgs.fields.part_edit import PartEdit
from texgs.fields.surfels.model_file import write_model
from texgs.fields.surfels.variants import write_texture
from texgs.scene.cut_view import scene_and_volume
from texgs.scene.frame import frame, point_at
from texgs.scene.scene import Scene, SceneModel
from texgs.scene.shot import Mode
from texgs.scene.twin import Twin, range_of
from texgs.viewer.frames import comparison
from texgs.viewer.messages import Orbit, View
from texgs.viewer.standalone import pack
from texgs.volume.generate import sphere
from texgs.volume.nrrd_file import open_grid
from texgs.volume.transfer import TransferFunction

CAMERAS = [
    orbit(30, 20, 3, 40, 96, 64),
    orbit(-110, 75, 2, 50, 64, 96),
    orbit(200, -35, 5, 20, 80, 80),
    orbit(85, 0, 0.9, 60, 64, 48),
    orbit(0, 90, 2.5, 30, 33, 47),
]
CAMERA = orbit(20, 10, 4, 30, 96, 80)
FROM_BELOW = orbit(-130, -40, 2.5, 40, 64, 90)
NEAR = orbit(20, 10, 3, 40, 96, 80)
SIDE, BELOW = Light("directional", 100, 30), Light("directional", -60, -50)
MODES = [mode for mode in get_args(Mode) if mode != "volume"]
LEVELS = 3  # of 255: a pixel of the rasterizer ends where 1e-4 of the light is left, ours does not
LEAST = 38.0  # dB; samples are codes of 8 bits, and steps are longer than those of the caster
CLOSE = 50.0  # dB: the page rounds surfels and texels
WIDE = TransferFunction(((0.1, 0), (0.2, 0.3), (0.9, 0.1)), ((0.1, 0.9, 0.2, 0.1), (0.9, 0.1, 0.9, 0.4)))
TILTED = Cuts([Plane([1.0, 2.0, 0.5], 0.2), Plane([0.0, 0.0, -1.0], 0.3)], Box([-0.6] * 3, [0.5] * 3))
CUTS = Cuts([Plane([1.0, 0.2, 0.0], 0.1), Plane([0.0, 1.0, 0.3], 0.2)])
BOX = Cuts(box=Box([-0.3, -0.4, -0.2], [0.2, 0.3, 0.4]))
FACE_LIGHTS = ("shaded", "unlit")
VOLUMES = {"sphere": lambda: sphere(40), "waves": waves, "flat": lambda: waves((24, 2, 20), (1, 3, 1))}
FLOATS = waves(nested().values.shape).values
LUMPS = image_on(nested(), FLOATS)
CHANNELS = {  # of a volume: masks of labels, and an image as well
    "labels": scene_of_labels,
    "image and labels": lambda folder: scene_of_labels(folder, LUMPS),
    "in a label": lambda folder: scene_of_labels(folder, replace(nested(), values=FLOATS), within=1),
}
PARTS = [PartEdit(), PartEdit(palette=(0.1, 0.6, 0.2)), PartEdit(opacity=0.4, specular=3.0)]
GLOSSY = {"specular": 4.0, "shininess": 0.2}
EDITS = [  # of the model with two segments, and of the next one
    (PartEdit(), PartEdit(visible=False)),
    (PartEdit(opacity=0.15), PartEdit()),
    (PartEdit(opacity=20.0), PartEdit()),
    (PartEdit(palette=(0.9, 0.1, 0.3)), PartEdit()),
    (PartEdit(**GLOSSY, tint=(1.0, 0.7, 0.2)), PartEdit(tint=(0.2, 0.4, 1.0))),
    (PartEdit(**GLOSSY, ambient=0.3, diffuse=1.7), PartEdit()),
]
OF_VOLUMES = [
    PartEdit(visible=False),
    PartEdit(opacity=0.3),
    PartEdit(opacity=5.0, palette=(0.1, 0.8, 0.2)),
    PartEdit(**GLOSSY, ambient=0.2, diffuse=1.5),
    PartEdit(**GLOSSY, tint=(1.0, 0.5, 0.1)),
]
FAINT = [PartEdit(opacity=0.1)] * 3 + [PartEdit(opacity=0.1, palette=(0.2, 0.2, 0.9)), PartEdit(opacity=0.1)]
LATER = {  # edits of a series that hold through time
    "light": SIDE,
    "cuts": Cuts([Plane([0.0, 1.0, 0.2], 0.2)]),
    "background": (0.2, 0.3, 0.5),
    "volume": None,
    "edits": [
        PartEdit(opacity=0.4, specular=3.0),
        PartEdit(palette=(0.9, 0.2, 0.1), opacity=2.0),
        PartEdit(diffuse=1.5),
    ],
}

WITHOUT_FLOAT_BLEND = """() => {
  const known = WebGL2RenderingContext.prototype.getExtension;
  WebGL2RenderingContext.prototype.getExtension = function (name) {
    return name === "EXT_float_blend" ? null : known.call(this, name);
  };
}"""


@pytest.fixture(scope="module")
def drawing(chromium, tmp_path_factory):
    """The drawing of a scene by its name, each opened once."""

    @cache
    def opened(name):
        folder = tmp_path_factory.mktemp(name)
        if name in VOLUMES:
            return Drawing(chromium, scene_of_volume(folder, VOLUMES[name]()), has_volume=True)
        if name in CHANNELS:
            return Drawing(chromium, CHANNELS[name](folder), has_volume=True)
        if name == "series":
            return Drawing(chromium, scene_of_series(folder))
        if name == "bright":  # texels beyond eight bits
            model = ball(5)
            model.parameters["texels"][::2] += 1.5
            models = {"A": SceneModel(write_model(folder / "a.safetensors", model), PartEdit(ambient=0.2))}
            return Drawing(chromium, Scene(models), is_exact=True)
        script = WITHOUT_FLOAT_BLEND if name == "halves" else "() => {}"
        return Drawing(chromium, scene_of_parts(folder), is_exact=True, script=script)

    every = []
    yield lambda name: every.append(opened(name)) or every[-1]
    assert [each.errors for each in every if each.errors] == []


def changed(scene, edits=(), time=None, functions=(), **fields):
    """A scene with other edits, of its parts in their order, at a step, with functions to try."""
    scene = scene if time is None else scene.at(time)
    left, models = iter([*edits, *scene.edits[len(edits) :]]), {}
    for name, entry in scene.models.items():
        own = next(left)
        segments = {key: replace(each, edit=next(left)) for key, each in entry.segments.items()}
        models[name] = replace(entry, edit=own, segments=segments)
    if functions:
        ends = ends_of(open_grid(scene.volume.file))
        fields["functions"] = {name: tf.scaled(*ends) for name, tf in functions}
    return replace(scene, models=models, **fields)


def cases(names, cameras, modes, changes, limit):
    """All of them by all others: scene, camera, mode, change, limit."""
    return [(*each, limit) for each in product(names, cameras, modes, changes)]


TRIED = {"functions": (("high", WIDE), ("new", HIGH))}
LIGHTS = [{"light": light} for light in (HEADLIGHT, SIDE, BELOW)]
FACES = [{"cuts": replace(cuts, faces=faces), "light": SIDE} for cuts in (CUTS, BOX) for faces in FACE_LIGHTS]
SLICES = [{"cuts": replace(cuts, faces="slice")} for cuts in (CUTS, BOX)]
SHADOWS = [
    {"light": replace(light, shadows=0.9, occlusion=occlusion), "cuts": cuts}
    for light, occlusion in ((SIDE, 0.0), (SIDE, 0.7), (HEADLIGHT, 0.7))
    for cuts in (NO_CUTS, CUTS)
]
TIMES = [{"time": time} for time in (4, 0, 1, BEGIN)]
CASES = [  # the limit is the least PSNR in dB, or how many levels, or both where something is cut
    *cases(["parts"], CAMERAS, ["shaded"], LIGHTS, LEVELS),
    *cases(["parts"], CAMERAS[:1], MODES, [{"light": SIDE}], LEVELS),
    *cases(
        *(["parts"], CAMERAS[1:2], ["shaded"]),
        [{"light": SIDE, "edits": [own, *PARTS[1:], other]} for own, other in EDITS],
        LEVELS,
    ),
    *cases(["parts"], CAMERAS, ["shaded", "depth", "discs"], [{"cuts": TILTED}], "cut"),
    *cases(["parts"], CAMERAS, ["shaded"], [{**light, "edits": FAINT} for light in LIGHTS[:2]], 1),
    ("parts", CAMERAS[0], "depth", {"edits": [PartEdit(opacity=0.02)] * 5}, 1),  # nothing says what is near
    *cases(["halves"], CAMERAS, ["shaded"], [{"light": SIDE}], LEVELS),
    ("halves", CAMERAS[0], "shaded", {"edits": [PartEdit(opacity=0.1)] * 5}, 1),
    ("bright", CAMERAS[0], "shaded", {}, LEVELS),
    *cases(VOLUMES, [CAMERA, FROM_BELOW], ["volume"], LIGHTS[:2], LEAST),
    *cases(VOLUMES, [CAMERA], ["volume"], [{"edits": [edit]} for edit in OF_VOLUMES], LEAST),
    *cases(VOLUMES, [CAMERA], ["volume", "shaded"], [TRIED], LEAST),
    *cases(VOLUMES, [CAMERA], ["volume", "shaded"], FACES, LEAST - 3),
    *cases([*VOLUMES, *CHANNELS], [CAMERA], ["volume", "shaded"], SLICES, CLOSE),
    # Cells of light in a page are not smaller than those between its samples.
    *cases(["sphere", "waves"], [CAMERA], ["volume", "shaded"], SHADOWS, LEAST - 3),
    *cases(["flat", *CHANNELS], [CAMERA], ["volume", "shaded"], SHADOWS, LEAST - 7),
    *cases(CHANNELS, [CAMERA, FROM_BELOW], ["volume"], LIGHTS[:2], LEAST),
    *cases(CHANNELS, [CAMERA], ["volume"], [{"edits": [edit]} for edit in OF_VOLUMES], LEAST),
    *cases(CHANNELS, [CAMERA], ["volume", "shaded"], FACES, LEAST - 3),
    # A volume has one material: models with others are seen below faces.
    *cases(
        *(VOLUMES, [CAMERA], ["shaded"]),
        [{"edits": [PartEdit(ambient=0.2, diffuse=0.1)], "cuts": CUTS, "light": SIDE}],
        40.0,
    ),
    *cases(["series"], [NEAR], ["shaded"], TIMES, CLOSE),
    *cases(["series"], [NEAR], ["normal"], TIMES, CLOSE - 6),
    *cases(["series"], [NEAR], ["shaded"], [{**time, **LATER} for time in TIMES[:2]], CLOSE - 12),
]


@pytest.mark.parametrize(("name", "camera", "mode", "change", "limit"), CASES)
def test_a_page_draws_what_texgs_renders(drawing, name, camera, mode, change, limit):
    opened = drawing(name)
    seen = changed(opened.scene, **change)
    expected, got = opened.render(seen, camera, mode), opened.draw(seen, camera, mode)
    assert expected.std() > 5, "something is seen"
    worst = np.abs(expected - got).max(axis=2)
    if limit == "cut":
        assert not np.array_equal(expected, opened.render(opened.scene, camera, mode))
        assert (worst > LEVELS).mean() < 0.002, "fragments on a plane but for rounding"
    elif isinstance(limit, int):
        assert worst.max() <= limit
    else:
        assert closeness(expected, got) > limit


def test_halves_are_used_where_floats_cannot_be_blended(drawing):
    page = drawing("halves").page
    assert page.evaluate("renderer._pass.target.format[0] === WebGL2RenderingContext.RGBA16F")


@pytest.mark.parametrize("name", VOLUMES)
def test_cuts_with_looks_have_faces_of_the_volume_over_the_models(chromium, tmp_path, name):
    texture = write_texture(tmp_path / "look.safetensors", ball(1))
    scene = scene_of_volume(tmp_path, VOLUMES[name]())
    models = {**scene.models, "low": replace(scene.models["low"], texture=texture)}
    opened = Drawing(chromium, replace(scene, models=models, cuts=CUTS), has_volume=True)
    styled = opened.scene
    hollow = replace(styled, volume=None)
    bare, faces = frame(hollow.open(), CAMERA, hollow), opened.render(styled, CAMERA)
    got = closeness(opened.draw(styled, CAMERA), faces)
    assert got > max(32.0, closeness(bare, faces) + 3), "rims have a quarter of the resolution, and 8 bits"
    assert opened.errors == []


@pytest.mark.parametrize("mode", ["difference", "wipe"])
@pytest.mark.parametrize("name", VOLUMES)
def test_scene_and_volume_beside_each_other(drawing, name, mode):
    scene = drawing(name).scene
    image, truth = scene_and_volume(scene.open(), CAMERA, scene, Twin(scene))
    view = View(Orbit((0, 0, 0), 20, 10, 4, 30, 96, 80), mode=mode, gain=4.0, wipe=0.4)
    expected = comparison(view, image.color, truth.color)
    got = drawing(name).draw(scene, CAMERA, mode, gain=4, wipe=0.4)
    assert closeness(got, expected) > LEAST - 12 * (mode == "difference"), "differences are enlarged"


DEPTH = """([camera, scene, mode, pixel]) => {
  const view = { ...camera, viewmat: () => camera.viewmat, unproject: (place, depth) => depth };
  renderer.size = () => [camera.width, camera.height];
  return renderer.pointAt(view, scene, { mode }, pixel);
}"""


def depth_at(opened, scene, mode, column, row):
    """Where the page finds something at a pixel."""
    words = [view_of(CAMERA), opened.describe(scene), mode, [column, row]]
    return opened.page.evaluate(DEPTH, words)


@pytest.mark.parametrize("name", [*VOLUMES, *CHANNELS])
def test_a_click_finds_the_place_that_texgs_finds(drawing, name):
    """In the volume, on a face of a cut, or where a mode shows models alone."""
    opened, scene = drawing(name), drawing(name).scene
    composed = scene.open()
    for cuts in (NO_CUTS, CUTS, replace(CUTS, faces="slice")):
        seen = replace(scene, cuts=cuts)
        twin = Twin(seen)
        alpha = twin.render(CAMERA, seen, composed.palettes).alpha
        if cuts:
            alpha = torch.where(range_of(cuts, CAMERA).face >= 0, alpha, 0.0)
        row, column = divmod(int(alpha.argmax()), CAMERA.width)
        for mode in ("volume", "shaded"):
            point = point_at(composed, CAMERA, seen, mode, twin, (column, row))
            depth = float(
                CAMERA.viewmat[2, :3].double() @ torch.tensor(point).double() + CAMERA.viewmat[2, 3]
            )
            assert depth_at(opened, seen, mode, column, row) == pytest.approx(depth, abs=5e-3)
            assert depth_at(opened, seen, mode, 0, 0) is None, "the background"
    depth = composed.render(CAMERA, HEADLIGHT, scene.edits, outputs=("depth",)).depth[40, 48]
    assert depth_at(opened, scene, "normal", 48, 40) == pytest.approx(float(depth), abs=5e-3)


@pytest.mark.parametrize("name", VOLUMES)
def test_moving_pictures_have_longer_steps(drawing, name):
    scene = drawing(name).scene
    moving, still = (drawing(name).draw(scene, CAMERA, "volume", moving=each) for each in (True, False))
    assert 30 < closeness(moving, still) < 80


def test_steps_differ_and_textures_stay_on_the_card(drawing):
    opened = drawing("series")
    opened.page.evaluate(
        "() => { globalThis.made = 0; const gl = renderer._gl, make = gl.createTexture;"
        " gl.createTexture = () => { made += 1; return make.call(gl); }; }"
    )
    first, *_, last = [opened.draw(opened.scene.at(time), NEAR) for time in range(COUNT)]
    assert closeness(first, last) < 30
    assert opened.page.evaluate("made") == 0


def test_the_background_is_that_of_the_scene(drawing):
    opened = drawing("parts")
    hidden = changed(opened.scene, [PartEdit(visible=False)] * 5, background=(0.2, 0.4, 0.6))
    assert (opened.draw(hidden, CAMERAS[0]) == [51, 102, 153]).all()
    assert (opened.draw(hidden, CAMERAS[0], "alpha") == 0).all()


def test_surfels_are_sorted_again_where_their_order_may_be_another(drawing):
    opened = drawing("parts")
    opened.draw(opened.scene, CAMERAS[2])
    opened.page.evaluate(
        "() => { const order = renderer._order, sort = order.farToNear; globalThis.sorted = 0;"
        " order.farToNear = () => { sorted += 1; return sort.call(order); }; }"
    )
    counts, half = [], PartEdit(opacity=0.5, palette=(1, 0, 0))
    for camera, edit in (
        (CAMERAS[0], PartEdit()),
        (CAMERAS[0], half),
        (CAMERAS[0], replace(half, visible=False)),
        (CAMERAS[1], replace(half, visible=False)),
        (CAMERAS[1], replace(half, visible=False, opacity=0.2)),
    ):
        opened.draw(changed(opened.scene, [*PARTS, edit]), camera)
        counts.append(opened.page.evaluate("sorted"))
    opened.page.evaluate("() => { delete renderer._order.farToNear; }")
    assert np.diff([0, *counts]).tolist() == [1, 0, 1, 1, 0]


@pytest.mark.parametrize("count", [0, 1, 7, 5000])
def test_depths_are_sorted_exactly_and_ties_as_the_rasterizer_has_them(drawing, count):
    depths = np.random.default_rng(count).exponential(size=count).astype(np.float32)
    depths[::3] = depths[: len(depths[::3])].round(1) + np.float32(0.2)  # many are the same
    order = drawing("parts").page.evaluate(
        "depths => { const order = new DepthOrder(depths.length); depths.forEach((z, i) => order.add(i, z));"
        " return [...order.farToNear()]; }",
        depths.tolist(),
    )
    assert order == np.argsort(depths, kind="stable")[::-1].tolist()


def test_half_precision_is_read_exactly(drawing):
    halves = np.arange(2**16, dtype=np.uint16).view(np.float16)
    finite = np.isfinite(halves)
    values = drawing("parts").page.evaluate("bits => bits.map(halfToFloat)", np.flatnonzero(finite).tolist())
    assert np.array_equal(np.array(values, np.float32), halves[finite].astype(np.float32))


def test_texels_that_no_page_can_hold_are_refused(tmp_path):
    model = ball(5)
    model.parameters["texels"][3, 1] = 300
    scene = Scene({"A": SceneModel(write_model(tmp_path / "a.safetensors", model))})
    refused(lambda: pack(scene.open()), "^texels: expected at most 255.992, got 300")
