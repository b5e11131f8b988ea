"""Shadows of pages without a volume: what they carry for surfels, and what a browser makes of it."""

import io
import json
import re
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from tests.refusals import refused
from tests.viewer.drawing import closeness, drawn, open_renderer
from tests.viewer.drawn_scenes import BEGIN, scene_of_series, scene_of_volume, waves
from tests.viewer.in_browser import opened_file, settle, shown
from texgs.core.camera import orbit
from texgs.core.cuts import Cuts, Plane
from texgs.core.light import HEADLIGHT, Light, random_lights
from texgs.fields.part_edit import PartEdit
from texgs.scene.export_keys import Export
from texgs.scene.exposure import exposed, exposure_of
from texgs.scene.frame import frame, quantize
from texgs.scene.twin import Twin, range_of
from texgs.viewer.export import export
from texgs.viewer.page_light import LAMPS, harmonics, lamp_at, page_light
from texgs.viewer.page_volume import page_volume
from texgs.viewer.standalone import POSTER_SIDE, pack, scene_page
from texgs.volume.matter import even_directions

CAMERA = orbit(20, 10, 3, 40, 96, 80)
LAMP = Light("directional", 100, 30, shadows=0.9, occlusion=0.7)
BYTES_PER_SURFEL = 12
CLOSE = 50.0  # dB: the page rounds surfels and shares of light


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """Two balls in a lumpy body that is lit from the side."""
    return replace(scene_of_volume(tmp_path_factory.mktemp("lit"), waves()), light=LAMP)


def described(page):
    return json.loads(re.search(r'id="scene">([^<]*)<', page.text)[1])


def surfels(page):
    return re.search(r'id="surfels">([^<]*)<', page.text)[1]


def visible(scene, composed, twin, light):
    """Which share [N] of a lamp reaches each surfel."""
    alone = replace(light, shadows=1.0, occlusion=0.0)
    return exposure_of(composed, replace(scene, light=alone), twin)[:, 0].numpy()


# ---- What a page carries ----------------------------------------------------


def test_codes_stand_for_the_openness_and_the_closest_harmonics(scene):
    composed, twin = scene.open(), Twin(scene)
    light = page_light(scene, composed, twin)
    (low, *lows), (step, *steps) = np.transpose(light.scales)
    lamps = even_directions(LAMPS)
    got = harmonics(lamps).numpy() @ (light.codes[1:] * np.array(steps)[:, None] + np.array(lows)[:, None])
    x, y, z = lamps.double().numpy().T
    basis = np.linalg.qr(np.stack([x**0, x, y, z, x * y, y * z, z * x, x * x, y * y], axis=1))[0]
    truth = np.stack([visible(scene, composed, twin, lamp_at(lamp)) for lamp in lamps])
    assert truth.std(axis=0).max() > 0.2, "something casts shadows"
    assert np.abs(got - basis @ (basis.T @ truth)).max() < 5 * max(steps)
    openness = exposure_of(composed, replace(scene, light=replace(LAMP, shadows=0.0, occlusion=1.0)), twin)
    assert np.abs(light.codes[0] * step + low - openness[:, 1].numpy()).max() < 0.51 / 255


def test_lamps_are_where_their_directions_point(scene):
    for lamp in even_directions(9):
        assert np.allclose(lamp_at(lamp).direction(CAMERA), lamp, atol=1e-6)


def test_it_takes_few_bytes_and_tells_how_many(scene, tmp_path):
    composed = scene.open()
    light = page_light(scene, composed, Twin(scene))
    more = len(pack(composed, light)) - len(pack(composed))
    assert more < BYTES_PER_SURFEL * len(composed) + 1500, "scales take some, too"
    notes = export(tmp_path / "lit.html", scene, Export("html"))
    count = len(composed)
    assert notes == [f"Light in the page: {light}"]
    assert re.fullmatch(rf"shadows and occlusion of {count} surfels in 0.\d\d MB", str(light))
    assert str(light) in (tmp_path / "lit.html").read_text()


def test_a_page_without_the_volume_says_that_its_cuts_have_no_faces(scene, tmp_path):
    cut = replace(scene, light=HEADLIGHT, cuts=Cuts((Plane((1.0, 0.0, 0.0), 0.0),)))
    (note,) = export(tmp_path / "cut.html", cut, Export("html"))
    assert note == "Cuts in the page: without faces, which need the volume, too (--volume)"
    (note,) = export(tmp_path / "whole.html", cut, Export("html", volume=1.0))
    assert note.startswith("Volume in the page: ")


def test_pages_can_shadow_with_the_volume_or_where_the_scene_has_shadows(scene):
    plain = replace(scene, light=LAMP.unhidden)
    page = scene_page(plain, "plain")
    assert page.light is None
    assert surfels(page) == pack(scene.open())
    assert described(page)["can_shadow"] is False
    whole = scene_page(plain, "whole", volume=page_volume(plain, 1))
    assert whole.light is None
    assert surfels(whole) == surfels(page)
    assert described(whole)["can_shadow"] is True
    for light in (
        replace(LAMP, occlusion=0.0),
        replace(HEADLIGHT, shadows=0.5),
        replace(HEADLIGHT, occlusion=0.5),
    ):
        lit = scene_page(replace(scene, light=light), "lit")
        assert lit.light is not None
        assert described(lit)["can_shadow"] is True
        assert described(lit)["occlusion"] == light.occlusion


def test_a_scene_without_its_volume_is_refused(scene):
    refused(lambda: scene_page(replace(scene, volume=None), "lit"), "expected the volume of the scene")


def test_a_scene_of_which_nothing_is_seen_has_no_shadows(scene):
    models = {name: replace(each, edit=PartEdit(visible=False)) for name, each in scene.models.items()}
    page = scene_page(replace(scene, models=models), "hidden")
    assert page.light is None
    assert described(page)["can_shadow"] is False


def test_the_poster_has_shadows_and_hollow_cuts(scene):
    cut = replace(scene, cuts=Cuts([Plane([1.0, 0.0, 0.0], 0.0)]))
    composed, page = cut.open(), scene_page(cut, "cut")
    view, fov_y = described(page)["views"][0], described(page)["fov_y"]
    place = (view["azimuth"], view["polar"], view["distance"], fov_y, POSTER_SIDE, POSTER_SIDE)
    camera = orbit(*place, target=view["target"])
    hollow = exposed(composed, cut, Twin(cut)).render(
        *(camera, cut.light, cut.edits), depth_range=range_of(cut.cuts, camera).depth_range
    )
    poster = np.asarray(Image.open(io.BytesIO(page.poster)))
    assert closeness(poster, quantize(hollow.color)) > 35
    assert closeness(poster, frame(composed, camera, cut, twin=Twin(cut))) < 30, "faces"


# ---- What a browser draws ---------------------------------------------------


@pytest.fixture(scope="module")
def drawing(chromium, scene):
    """A page that draws a scene without its volume, and the description of the scene in it."""
    page = scene_page(scene, "lit")
    tab, errors = chromium.new_page(), []
    tab.on("pageerror", lambda error: errors.append(str(error)))
    open_renderer(tab, surfels(page), described(page))
    yield tab, described(page)
    assert errors == []


@pytest.mark.parametrize("light", [HEADLIGHT, *random_lights(3, 5)])
def test_harmonics_come_close_to_the_shadows_of_the_volume(scene, drawing, light):
    composed, (tab, description) = scene.open(), drawing
    lit = replace(scene, light=replace(light, shadows=0.9, occlusion=0.7))
    expected = frame(composed, CAMERA, lit, twin=Twin(lit)).astype(int)
    bare = frame(composed, CAMERA, replace(scene, light=light)).astype(int)
    angles = {"azimuth": light.azimuth, "polar": light.polar}
    own = {**description, "light": None if light == HEADLIGHT else angles}
    got = drawn(tab, CAMERA, own).astype(int)
    least = CLOSE if light == HEADLIGHT else min(max(36, closeness(bare, expected) + 3), 60)
    assert closeness(got, expected) > least
    none = drawn(tab, CAMERA, {**own, "shadows": 0, "occlusion": 0}).astype(int)
    assert closeness(none, bare) > CLOSE


def test_steps_of_a_series_have_shadows_where_they_are_known(chromium, tmp_path):
    scene = replace(scene_of_series(tmp_path), light=LAMP)
    page = scene_page(scene, "series")
    assert f"steps other than {BEGIN}" in " ".join(page.text.split())
    tab = chromium.new_page()
    open_renderer(tab, surfels(page), described(page), steps=page.steps.packed.values())
    for time in (BEGIN, 0):
        lit = {**described(page), "time": time}
        dark, bright = (drawn(tab, CAMERA, each) for each in (lit, {**lit, "shadows": 0, "occlusion": 0}))
        assert np.array_equal(dark, bright) is (time != BEGIN)


def test_sliders_of_the_page_take_shadows_away(chromium, scene, tmp_path):
    export(tmp_path / "lit.html", scene, Export("html"))
    with opened_file(chromium, tmp_path / "lit.html") as page:
        dark = shown(page)
        for name in ("Shadows", "Occlusion"):
            page.get_by_label(name).first.fill("0")
        settle(page)
        assert shown(page).mean() > dark.mean() + 0.5
        assert page.locator("#words textarea").input_value() == "shadows=0 occlusion=0"
    export(tmp_path / "plain.html", replace(scene, light=LAMP.unhidden), Export("html"))
    with opened_file(chromium, tmp_path / "plain.html") as page:
        assert page.get_by_label("Shadows").count() == 0
