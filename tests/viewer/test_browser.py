"""The page in a real browser: what it shows is what `texgs render` writes, and it finds a server again."""

import re

import numpy as np
import pytest
import torch
from PIL import Image

from tests.edit.lift_scenes import two_balls
from tests.scene.balls import balls_in_a_volume
from tests.viewer.in_browser import (
    JPEG,
    LINK,
    PLACE,
    WAIT,
    drag,
    expect,
    opened,
    pixels,
    rendered,
    save_as,
    served,
    shown,
    still,
)
from tests.viewer.training_views import write_results
from texgs.core.camera import orbit
from texgs.core.cuts import Cuts, Plane
from texgs.scene.scene_file import read_scene, write_scene
from texgs.scene.segment_file import read_segment

BLUE = (0.3, 0.1, 0.1)  # where the blue ball is seen


def test_faces_of_cuts_show_slices_where_there_is_a_volume(chromium, scene_file, tmp_path):
    cuts = Cuts([Plane([1.0, 0.0, 0.0], 0.05)], faces="slice", window=(-1.0, 1.0))
    volume = write_scene(tmp_path / "sliced.yaml", balls_in_a_volume(tmp_path, cuts=cuts))
    with served(volume) as (_, address), opened(chromium, address) as page:
        faces = page.get_by_label("Faces")
        expect(faces).to_have_value("slice")
        assert still(page) == rendered(volume, page)
        faces.select_option("Shaded")
        faces.select_option("Slices")
        expect(page.get_by_role("listitem").last).to_have_text("cuts 1 plane, slice")
        save_as(page, "again.yaml")
        assert read_scene(tmp_path / "again.yaml").cuts == cuts
    with served(scene_file) as (_, address), opened(chromium, address) as page:
        expect(page.get_by_label("Faces").locator("option")).to_have_text(["Shaded", "Without light"])


def test_what_is_edited_shows_and_is_saved(chromium, scene_file):
    with served(scene_file) as (_, address), opened(chromium, address) as page:
        assert (first := still(page)) == rendered(scene_file, page)
        page.get_by_role("textbox", name="Palette of TF01").fill("#ff0000")
        page.get_by_role("spinbutton", name="Opacity of TF02, as a number").fill("0.3")
        page.keyboard.press("Tab")
        page.get_by_role("checkbox", name="TF02").uncheck()
        save_as(page, "red.yaml")
        red = scene_file.parent / "red.yaml"
        edits = [model.edit for model in read_scene(red).models.values()]
        assert edits[0].palette == (1, 0, 0)
        assert (edits[1].opacity, edits[1].visible) == (0.3, False)
        expected = rendered(red, page)
        assert still(page) == expected
        assert np.abs(shown(page) - pixels(expected)[:-50]).mean() < JPEG
        steps = ["TF01 palette #ff0000", "TF02 opacity 0.3", "TF02 visible off"]
        expect(page.get_by_role("listitem")).to_have_text(steps)
        opened_as = page.get_by_text("As opened", exact=True)
        page.keyboard.press("b")
        expect(opened_as).to_be_visible()
        assert still(page) == first
        page.get_by_role("button", name="Undo").click()
        expect(opened_as, "who edits sees it").to_be_hidden()
        page.get_by_role("button", name="Undo").click()
        expect(page.get_by_role("checkbox", name="TF02")).to_be_checked()
        expect(page.get_by_role("spinbutton", name="Opacity of TF02, as a number")).to_have_value("1")
        save_as(page, "undone.yaml")
        kept = still(page)
        page.keyboard.press("Control+Shift+Z")
        expect(page.get_by_role("spinbutton", name="Opacity of TF02, as a number")).to_have_value("0.3")
    undone = scene_file.parent / "undone.yaml"
    with served(undone) as (_, address), opened(chromium, address) as page:
        assert still(page) == kept


def test_a_movement_is_one_step(chromium, scene_file):
    with served(scene_file) as (_, address), opened(chromium, address) as page:
        slider = page.get_by_role("slider", name="Opacity of TF01")
        drag(page, slider, (0.5, 0.5), (0.05, 0.5))
        expect(page.get_by_role("listitem")).to_have_text([f"TF01 opacity {float(slider.input_value()):g}"])
        assert float(slider.input_value()) < 0.3
        expect(page.get_by_role("slider", name="Shadows"), "there is no volume").to_have_count(0)
        drag(page, page.locator(".ball"), (0.5, 0.5), (0.9, 0.5))
        expect(page.get_by_role("listitem")).to_have_text(
            [re.compile("TF01 opacity"), re.compile("light azimuth .*°, polar .*°")]
        )
        # the right rim of the ball is to the right of a camera at azimuth 40
        azimuth = page.get_by_role("spinbutton", name="Azimuth of the light, degrees, as a number")
        assert 90 < float(azimuth.input_value()) < 135
        for _ in range(3):  # a burst of keys is one, too
            slider.press("ArrowRight")
        page.keyboard.press("Tab")
        slider.press("ArrowLeft")
        steps = page.get_by_role("listitem")
        expect(steps).to_have_count(4)
        first, last = (float(each.split()[-1]) for each in steps.all_text_contents()[2:])
        assert first - last == pytest.approx(0.01)
        save_as(page, "moved.yaml")
        assert still(page) == rendered(scene_file.parent / "moved.yaml", page)


def test_sliders_under_the_light_are_of_shadows_and_occlusion(chromium, sphere_file):
    with served(sphere_file) as (_, address), opened(chromium, address) as page:
        first, shadows = still(page), page.get_by_role("slider", name="Shadows", exact=True)
        expect(page.get_by_text("casts no shadows")).to_be_visible()
        page.get_by_role("spinbutton", name="Occlusion of ambient light, as a number").fill("0.5")
        page.get_by_role("checkbox", name="Headlight").uncheck()
        drag(page, shadows, (0.5, 0.5), (0.7, 0.5))
        drag(page, page.locator(".ball"), (0.5, 0.5), (0.9, 0.5))
        share = float(shadows.input_value())
        assert 0.5 < share < 1
        steps = page.get_by_role("listitem")
        light = re.compile("light azimuth .*°, polar .*°")
        expect(steps).to_have_text(["occlusion 0.5", light, f"shadows {share:g}", light])
        expect(page).to_have_url(re.compile("shadows"), timeout=WAIT)
        save_as(page, "dark.yaml")
        dark, shadowed = sphere_file.with_name("dark.yaml"), still(page)
        saved = read_scene(dark).light
        assert (saved.kind, saved.shadows, saved.occlusion) == ("directional", share, 0.5)
        assert shadowed == rendered(dark, page) != first
        page.goto(f'{address}#edits=[{{"part":"","key":"shadows","value":2}}]')
        expect(page.get_by_text("This page cannot use of the link: shadows.")).to_be_visible()
        page.goto(address + LINK)
        page.get_by_role("button", name="Reset shadows").click()
        expect(shadows).to_have_value("0")
        page.get_by_role("button", name="Undo").click()
        expect(shadows).to_have_value(f"{share:g}")
        assert still(page) == shadowed


def test_planes_cut_move_and_tilt(chromium, scene_file):
    with served(scene_file) as (_, address), opened(chromium, address) as page:
        page.get_by_role("button", name="Add a plane").click()
        arrow = page.get_by_role("slider", name="Plane 1: arrow keys move it")
        line, tip = page.locator(".plane .reach"), page.locator(".plane .tip")
        seen = line.bounding_box()
        drag(page, line, (0.5, 0.5), (-0.5, 0.5))  # along +x, to the left and nearer
        expect(page.get_by_role("listitem")).to_have_count(2)
        moved = float(arrow.get_attribute("aria-valuenow"))
        assert moved > 0.05
        assert line.bounding_box()["x"] < seen["x"] - seen["width"] / 3, "the arrow follows the pointer"
        arrow.press("ArrowRight")
        assert float(arrow.get_attribute("aria-valuenow")) == pytest.approx(moved + 0.01, abs=1e-3)
        drag(page, tip, (0.5, 0.5), (0.5, -1.5))
        tilted = page.get_by_role("spinbutton", name="Polar of the normal of plane 1, degrees, as a number")
        assert 10 < float(tilted.input_value()) < 80
        page.get_by_role("button", name="Snap to y: plane 1").click()
        expect(tilted).to_have_value("90")
        page.get_by_role("checkbox", name="Box").check()
        page.get_by_role("spinbutton", name="Highest x of the box, as a number").fill("0.25")
        page.keyboard.press("Tab")
        side = page.get_by_role("slider", name="Lowest y of the box: arrow keys move it")
        low = -float(side.get_attribute("aria-valuenow"))
        side.press("ArrowRight")  # outwards
        assert float(side.get_attribute("aria-valuenow")) == pytest.approx(-low + 0.01, abs=1e-3)
        drag(page, side.locator(".reach"), (0.5, 0.5), (0.5, -3))  # upwards, inwards
        assert float(side.get_attribute("aria-valuenow")) < -low - 0.02
        page.get_by_role("button", name="Flip plane 1").click()
        save_as(page, "cut.yaml")
        cuts = read_scene(scene_file.parent / "cut.yaml").cuts
        assert cuts.planes[0].normal == [0, -1, 0]
        assert cuts.box.high[0] == 0.25
        page.get_by_role("checkbox", name="Plane 1").uncheck()
        expect(page.get_by_role("listitem").last).to_have_text("cuts box")
        expect(arrow).to_be_hidden()
        page.get_by_role("checkbox", name="Plane 1").check()
        save_as(page, "again.yaml")
        assert read_scene(scene_file.parent / "again.yaml").cuts == cuts, "what is off is kept in the page"
        page.get_by_role("button", name="Remove plane 1").click()
        page.get_by_role("button", name="Undo").click()
        expect(page.get_by_role("checkbox", name="Plane 1")).to_be_checked()


def test_a_scene_is_seen_beside_its_volume(chromium, sphere_file):
    with served(sphere_file) as (_, address), opened(chromium, address) as page:
        scene, show = still(page), page.get_by_label("Show", exact=True)
        expect(page.get_by_text("PSNR of this view")).to_have_count(0)
        show.select_option("Volume")
        truth = still(page)
        assert truth == rendered(sphere_file, page, "--mode", "volume")
        assert np.abs(shown(page) - pixels(truth)[:-50]).mean() < JPEG
        show.select_option("Scene and volume")
        expect(page.get_by_text("PSNR of this view")).to_contain_text("on the object", timeout=WAIT)
        expect(page.get_by_text("PSNR of this view")).to_contain_text("SSIM 0.")
        line = page.get_by_role("slider", name="Line between scene and volume")
        expect(line).to_have_attribute("aria-valuenow", "50")
        line.press("ArrowLeft")
        expect(line).to_have_attribute("aria-valuenow", "48")
        drag(page, line, (0.5, 0.5), (5, 0.5))
        assert int(line.get_attribute("aria-valuenow")) > 55
        line.press("End")
        assert pixels(still(page)).tolist() == pixels(scene).tolist()
        line.press("Home")
        assert pixels(still(page)).tolist() == pixels(truth).tolist()
        right = np.s_[60:-50, 40:]  # of the words at the line
        assert np.abs(shown(page)[60:, 40:] - pixels(truth)[right]).mean() < JPEG
        show.select_option("Scene − volume")
        expect(page.get_by_text("+25 %")).to_be_visible()
        first = shown(page)
        page.get_by_role("slider", name="Enlarged").press("End")
        expect(page.get_by_text("+6.25 %")).to_be_visible()
        assert shown(page).mean() < first.mean() - 1, "what is off has stronger colours"


def test_what_cannot_be_shown_leaves_no_picture_of_before(chromium, tmp_path):
    scene_file = write_scene(tmp_path / "scene.yaml", write_results(tmp_path))
    with served(scene_file) as (_, address), opened(chromium, address) as page:
        told = page.get_by_text("Training views show one transfer function each")
        assert shown(page).std() > 1
        for mode in ("Nearest training view", "Difference from that view"):
            page.get_by_label("Show", exact=True).select_option(mode)
            expect(told).to_be_visible(timeout=WAIT)
            nothing = shown(page)
            assert np.ptp(nothing[:150], axis=(0, 1)).max() == 0, "the sentence is below"
            page.get_by_role("checkbox", name="TF02").uncheck()
            expect(told).to_be_hidden(timeout=WAIT)
            assert (shown(page) != nothing).any(2).all(), "a difference of 0 is white"
            expect(page.locator("#marks"), "they are seen from the camera").to_be_hidden()
            page.locator("#picture").dblclick()
            expect(page.get_by_text("Double click on the scene in another mode")).to_be_visible(timeout=WAIT)
            page.get_by_role("button", name="Close").click()
            page.get_by_role("checkbox", name="TF02").check()
            expect(told).to_be_visible(timeout=WAIT)


def seen_at(page, place):
    """Where the known camera sees a place: x, y in pixels of the picture; and how large a unit is there."""
    box = page.locator("#picture").bounding_box()
    camera = orbit(*PLACE.values(), round(box["width"]), round(box["height"]))
    return camera.project(torch.tensor(place))[0].tolist(), float(camera.K[0, 0]) / PLACE["distance"]


def test_a_click_makes_a_segment(chromium, balls_file):
    weights = {"TEXGS_WEIGHTS": str(balls_file.parent)}  # GrabCut, wherever this runs
    with served(balls_file, **weights) as (_, address), opened(chromium, address, ratio=2) as page:
        page.get_by_role("button", name="New segment of balls").click()
        (x, y), _ = seen_at(page, BLUE)
        page.locator("#picture").click(position={"x": x, "y": y})
        expect(page.get_by_text("Mask by GrabCut.")).to_be_visible(timeout=WAIT)
        page.get_by_role("form", name="New segment").get_by_label("Name").fill("blue")
        page.get_by_role("button", name="Make segment").click()
        page.get_by_role("checkbox", name="blue").uncheck(timeout=WAIT)
        expect(page.get_by_role("listitem")).to_have_text(["balls/blue new", "balls/blue visible off"])
        expect(page).to_have_url(re.compile("balls%2Fblue"), timeout=WAIT)  # in the link
        page.get_by_role("button", name="Rename balls/blue").click()
        page.get_by_role("dialog").get_by_label("Name").fill("sea")
        page.keyboard.press("Enter")
        expect(page.get_by_role("checkbox", name="sea")).not_to_be_checked(timeout=WAIT)
        page.get_by_role("button", name="Undo").click()
        reds = shown(page)
        is_blue = (reds[..., 2] - reds[..., 0] > 100).mean()
        assert (reds[..., 0] - reds[..., 2] > 100).mean() > 0.01
        assert is_blue < 0.001
        page.get_by_role("button", name="Remove balls/blue").click()
        expect(page.get_by_role("checkbox", name="blue")).to_have_count(0)
        expect(page.get_by_role("checkbox", name="balls")).to_be_focused()
        for _ in range(3):
            page.get_by_role("button", name="Undo").click()
        expect(page.get_by_role("button", name="Nothing to undo")).to_be_disabled()


def test_what_is_drawn_around_becomes_a_segment(chromium, balls_file):
    weights = {"TEXGS_WEIGHTS": str(balls_file.parent)}  # GrabCut, wherever this runs
    with served(balls_file, **weights) as (_, address), opened(chromium, address) as page:
        page.get_by_role("button", name="New segment of balls").click()
        picture, url, clear = page.locator("#picture"), page.url, page.get_by_role("button", name="Clear")
        page.get_by_role("radio", name="Box").check()
        drag(page, picture, (0.02, 0.02), (0.2, 0.2))
        expect(page.get_by_text("outline: expected an object, got none")).to_be_visible(timeout=WAIT)
        expect(clear, "an outline on nothing is taken back").to_be_disabled()
        drag(page, picture, (0.02, 0.02), (0.98, 0.98))
        expect(page.get_by_text("Mask by GrabCut.")).to_be_visible(timeout=WAIT)
        clear.click()
        expect(page.get_by_text("Drag a box around what belongs to the segment.")).to_be_visible()
        page.get_by_role("radio", name="Lasso").check()
        box, (place, unit) = picture.bounding_box(), seen_at(page, BLUE)
        angles = np.linspace(0, 2 * np.pi, 40)
        ring = 0.3 * unit * np.stack([np.cos(angles), np.sin(angles)], 1) + place + [box["x"], box["y"]]
        page.mouse.move(*ring[0])
        page.mouse.down()
        for corner in ring[1:]:
            page.mouse.move(*corner)
        page.mouse.up()
        expect(page.get_by_text("Clicks inside add to it")).to_be_visible(timeout=WAIT)
        page.keyboard.press("Home")  # the camera stays
        page.get_by_role("button", name="Make segment").click()
        expect(page.get_by_role("checkbox", name="part1")).to_be_visible(timeout=WAIT)
        assert page.url == url
        save_as(page, "parts.yaml")
    segment = read_scene(balls_file.with_name("parts.yaml")).models["balls"].segments["part1"]
    model, number = two_balls()
    mask, is_blue = read_segment(segment.file, model), number == 1
    assert float((mask & is_blue).sum() / (mask | is_blue).sum()) > 0.95


def test_a_model_gets_the_style_of_a_picture(chromium, scene_file):
    weights = {"TEXGS_WEIGHTS": str(scene_file.parent)}  # none, wherever this runs
    with served(scene_file, **weights) as (_, address), opened(chromium, address) as page:
        first = still(page)
        page.get_by_role("button", name="New look of TF01").click()
        make = page.get_by_role("button", name="Make look", exact=True)
        expect(make).to_be_disabled()
        before = shown(page)
        page.get_by_role("button", name="Compare").click()
        page.get_by_role("radio", name="dots").check(force=True)  # its picture is what one clicks on
        expect(page.get_by_text("A preview: nothing has changed yet.")).to_be_visible(timeout=WAIT)
        assert np.abs(shown(page) - before).mean() > 1
        assert still(page) != first, "pictures have what the page shows"
        make.click()
        expect(page.get_by_role("listitem")).to_have_text(["TF01 dots"], timeout=WAIT)
        save_as(page, "dots.yaml")
        assert still(page) == rendered(scene_file.with_name("dots.yaml"), page)
        page.get_by_role("button", name="Undo").click()
        assert still(page) == first


def test_a_picture_is_dropped_and_words_are_followed(chromium, scene_file, tmp_path):
    Image.fromarray(np.zeros((64, 64, 3), np.uint8)).save(tmp_path / "black.png")
    with served(scene_file) as (_, address), opened(chromium, address) as page:
        page.get_by_role("button", name="New look of the scene").click()
        page.get_by_label("Another picture").set_input_files(tmp_path / "black.png")
        expect(page.get_by_role("radio", name="black.png")).to_be_checked(timeout=WAIT)
        page.get_by_label("or words").fill("turn it into gold")
        expect(page.get_by_role("radio", name="black.png")).not_to_be_checked()
        note = page.get_by_text("A preview: nothing has changed yet.")
        before = shown(page)
        expect(note).not_to_be_visible()
        page.get_by_label("or words").press("Tab")
        expect(note).to_be_visible(timeout=WAIT)
        assert np.abs(shown(page) - before).mean() > 1
        page.get_by_role("button", name="Make look").click()
        expect(page.get_by_role("listitem")).to_have_text(["TF01, TF02 turn it into gold"], timeout=WAIT)


def drop(page, name, content):
    """Drop a file onto the picture of the page."""
    make = """([name, bytes]) => {
      const data = new DataTransfer();
      data.items.add(new File([new Uint8Array(bytes)], name));
      return data;
    }"""
    data = page.evaluate_handle(make, [name, list(content)])
    page.dispatch_event("#picture", "drop", {"dataTransfer": data})


def thumbnail(page, name):
    """Mean colour of a picture on the scene, once it is there."""
    image = page.locator("label.style", has=page.get_by_role("radio", name=name)).locator("img")
    expect(image).to_have_attribute("src", re.compile("^blob:"), timeout=WAIT)
    return pixels(image.screenshot()).mean((0, 1))


def test_pictures_of_a_folder_are_on_the_scene_and_tried_at_once(chromium, scene_file, tmp_path):
    for name, color in (("red.png", "red"), ("blue.webp", "blue")):
        Image.new("RGB", (64, 64), color).save(tmp_path / name)
    (tmp_path / "broken.jpg").write_bytes(b"no picture")
    with served(scene_file, styles=tmp_path) as (_, address), opened(chromium, address) as page:
        page.get_by_role("button", name="New look of the scene").click()
        expect(page.get_by_text("broken.jpg: expected a picture")).to_be_visible(timeout=WAIT)
        red, blue = thumbnail(page, "red.png"), thumbnail(page, "blue.webp")
        assert red[0] > blue[0] + 20
        assert blue[2] > red[2] + 20
        first, before = still(page), shown(page)
        page.get_by_role("radio", name="red.png").check(force=True)
        expect(page.get_by_text("A preview: nothing has changed yet.")).to_be_visible(timeout=WAIT)
        assert (shown(page) - before)[..., 1].mean() < -1, "less green"
        page.keyboard.press("ArrowRight")  # inputs stay while a preview is made
        page.locator("#look-part").select_option("TF01")
        page.get_by_role("checkbox", name="Picture of a lit sphere").check()
        file = scene_file.parent / "green.png"
        Image.new("RGB", (64, 64), "lime").save(file)
        drop(page, "green.png", file.read_bytes())
        expect(page.get_by_role("radio", name="green.png")).to_be_checked(timeout=WAIT)
        green = thumbnail(page, "green.png")
        assert green[1] > max(green[0], green[2])
        drop(page, "notes.txt", b"no picture")
        expect(page.get_by_text("notes.txt cannot be used")).to_be_visible(timeout=WAIT)
        page.get_by_role("form", name="New look").get_by_role("button", name="Close").click()
        expect(page.get_by_role("listitem")).to_have_count(0)
        page.wait_for_timeout(500)
        assert still(page) == first


def test_a_look_keeps_the_hues_of_the_functions_as_a_slider_says(chromium, scene_file, tmp_path):
    Image.new("RGB", (64, 64), "red").save(tmp_path / "red.png")
    with served(scene_file, styles=tmp_path) as (_, address), opened(chromium, address) as page:
        page.get_by_role("button", name="New look of the scene").click()
        hue = page.get_by_role("slider", name="Hue of the look")
        number = page.get_by_role("spinbutton", name="Hue of the look, as a number")
        image = page.locator("label.style", has=page.get_by_role("radio", name="red.png")).locator("img")
        expect(hue).to_have_value("1")
        assert [hue.get_attribute(key) for key in ("min", "max", "step")] == ["0", "1", "0.05"]
        page.get_by_role("radio", name="red.png").check(force=True)
        expect(page.get_by_text("A preview: nothing has changed yet.")).to_be_visible(timeout=WAIT)
        free, small = shown(page), thumbnail(page, "red.png")
        source = image.get_attribute("src")
        hue.focus()
        for _ in range(3):
            page.keyboard.press("ArrowLeft")
        expect(number).to_have_value("0.85")
        page.keyboard.press("Home")
        expect(number).to_have_value("0")
        expect(image).not_to_have_attribute("src", source, timeout=WAIT)
        kept = shown(page)
        assert redness(thumbnail(page, "red.png")) < redness(small) - 10
        assert redness(kept) < redness(free) - 5
        source = image.get_attribute("src")
        page.get_by_role("button", name="Reset hue of the look").click()
        expect(hue).to_have_value("1")
        expect(image).not_to_have_attribute("src", source, timeout=WAIT)
        assert np.abs(shown(page) - free).mean() < JPEG
        number.fill("1.5")
        number.press("Tab")
        expect(page.get_by_text("Hue of the look: expected a number from 0 to 1, got 1.5.")).to_be_visible()
        expect(number).to_have_value("1")


def redness(colors):
    """Mean of how much more red than green colours [..., 3] have."""
    return (colors[..., 0] - colors[..., 1]).mean()


def test_edits_stand_in_the_link(chromium, scene_file):
    with served(scene_file) as (_, address), opened(chromium, address) as page:
        page.get_by_role("checkbox", name="TF02").uncheck()
        expect(page).to_have_url(re.compile("edits="), timeout=WAIT)
        link = page.url
        page.get_by_role("button", name="Undo").click()
        expect(page).not_to_have_url(re.compile("edits="), timeout=WAIT)
        page.goto("about:blank")
        page.goto(link)
        expect(page.get_by_text("The link has 1 other edit of this scene")).to_be_visible(timeout=WAIT)
        expect(page.get_by_role("checkbox", name="TF02")).to_be_checked()  # a step could be made again
        page.get_by_role("button", name="Make it on all pages").click()
        expect(page.get_by_role("checkbox", name="TF02")).not_to_be_checked(timeout=WAIT)
        expect(page.get_by_role("listitem")).to_have_text(["TF02 visible off"])
    with served(scene_file) as (_, other), opened(chromium, other) as page:
        page.goto("about:blank")
        page.goto(other + link[link.index("#") :])
        expect(page.get_by_role("checkbox", name="TF02")).not_to_be_checked(timeout=WAIT)


def test_pages_share_their_edits(chromium, scene_file):
    with served(scene_file) as (_, at), opened(chromium, at) as one, opened(chromium, at) as other:
        one.get_by_role("checkbox", name="Headlight").uncheck()
        expect(other.get_by_role("checkbox", name="Headlight")).not_to_be_checked()
        other.get_by_role("button", name="Undo").click()
        expect(one.get_by_role("checkbox", name="Headlight")).to_be_checked()


def test_a_page_too_many_waits_for_its_turn(chromium, scene_file):
    fifteen = """async () => {
      const address = new URL("socket", location.href.replace(/^http/, "ws"));
      window.others = Array.from({ length: 15 }, () => new WebSocket(address));
      await Promise.all(others.map((each) => new Promise((done) => { each.onmessage = done; })));
    }"""
    with served(scene_file) as (_, address), opened(chromium, address) as page:
        page.evaluate(fifteen)
        late = chromium.new_page()
        late.goto(address)
        told = late.get_by_text("16 pages of this scene are open")
        expect(told).to_be_visible(timeout=WAIT)
        page.evaluate("() => others[0].close()")
        expect(told).to_be_hidden(timeout=WAIT)
        expect(late.get_by_role("checkbox", name="TF02")).to_be_checked(timeout=WAIT)
        late.close()


def test_a_page_finds_a_server_that_was_started_again(chromium, scene_file):
    with served(scene_file) as (process, address):
        port = int(re.search(r":(\d+)/", address).group(1))
        with opened(chromium, address) as page:
            page.get_by_role("checkbox", name="Headlight").uncheck()
            page.get_by_role("checkbox", name="TF02").uncheck()
            steps = ["light azimuth 40°, polar 10°", "TF02 visible off"]
            expect(page.get_by_role("listitem")).to_have_text(steps)
            process.kill()
            lost = page.get_by_text("No connection to texgs view")
            expect(lost).to_be_visible(timeout=WAIT)
            with served(scene_file, port) as (_, again):
                assert again == address
                expect(lost).to_be_hidden(timeout=WAIT)
                page.get_by_role("checkbox", name="Headlight").uncheck()
                azimuth = page.get_by_role("spinbutton", name="Azimuth of the light, degrees, as a number")
                azimuth.fill("70")
                azimuth.press("Enter")
                page.get_by_role("button", name="Make the other edits again").click()
                newer = [steps[0], "light azimuth 70°, polar 10°", steps[1]]
                expect(page.get_by_role("listitem"), "the newer light stays").to_have_text(newer)
                expect(page.get_by_role("checkbox", name="TF02")).not_to_be_checked()
            expect(page.get_by_text("texgs view has ended. Start it again")).to_be_visible(timeout=WAIT)
            undone = page.get_by_text("Not done: there is no connection to texgs view.")
            expect(undone).to_have_count(0)
            for ask in ("Save", "Undo"):
                page.get_by_role("button", name=ask).click()
                if ask == "Save":
                    page.keyboard.press("Enter")
                expect(undone).to_be_visible()
                undone.get_by_role("button", name="Close").click()


def test_a_connection_that_falls_silent_is_noticed_and_made_again(chromium, scene_file):
    with served(scene_file) as (_, address):
        page, routes, silent = chromium.new_page(), [], [False]

        def connect(route):
            server = route.connect_to_server()
            server.on_message(lambda message: None if silent[0] else route.send(message))
            routes.append(route)

        page.clock.install()
        page.route_web_socket(re.compile("/socket$"), connect)
        page.goto(address)
        expect(page.locator("#pace")).to_contain_text("ms", timeout=WAIT)
        silent[0] = True
        page.clock.fast_forward(21_000)
        lost = page.get_by_text("No connection to texgs view")
        expect(lost).to_be_visible(timeout=WAIT)
        silent[0] = False
        page.clock.fast_forward(5_000)
        expect(lost).to_be_hidden(timeout=WAIT)
        assert len(routes) == 2
        page.close()
