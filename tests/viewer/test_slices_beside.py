"""Slices beside the scene, in a browser: the crosshair that all of them show, the window, and values."""

import re
from contextlib import contextmanager

import numpy as np
import pytest
import torch

from tests.viewer.in_browser import PLACE, WAIT, drag, expect, opened, save_as, served
from tests.viewer.test_slices import (
    EVERYTHING,
    EXPECTED,
    ORIGIN,
    SAMPLES,
    SPACING,
    point_of,
    write_patient_scene,
)
from texgs.core.camera import orbit
from texgs.core.cuts import NO_CUTS
from texgs.scene.scene_file import read_scene
from texgs.scene.twin import Twin
from texgs.volume.nrrd_file import open_grid
from texgs.volume.slices import place_at, windowed

MIDDLE = (3, 4, 2)
# Levels of the canvas at the middles of samples, and how many of these there are.
LEVELS = """(canvas, [columns, rows, x, y]) => {
  const pen = canvas.getContext("2d"), { width, height } = canvas;
  const scale = Math.min(width / (columns * x), height / (rows * y));
  const at = (i, of, step, side) => Math.floor(side / 2 + (i + 0.5 - of / 2) * step * scale);
  return Array.from({ length: rows }, (_, row) => Array.from({ length: columns }, (_, column) =>
    pen.getImageData(at(column, columns, x, width), at(row, rows, y, height), 1, 1).data[0]));
}"""


@pytest.fixture
def scene_file(tmp_path):
    return write_patient_scene(tmp_path)


@contextmanager
def beside(chromium, scene_file):
    """The page with its slices open."""
    with served(scene_file) as (_, address), opened(chromium, address) as page:
        wrong = []
        page.on("console", lambda said: wrong.append(said.text) if said.type == "error" else None)
        page.set_viewport_size({"width": 1200, "height": 1100})
        page.get_by_role("button", name="Slices", exact=True).click()
        says(page, *MIDDLE)
        yield page
        assert wrong == []


def says(page, i, j, k):
    """Expect the words of a sample, as the file has it."""
    place = [start + step * n for start, step, n in zip(ORIGIN, SPACING, (i, j, k), strict=True)]
    words = " ".join(f"{letter} {x:.1f}" for letter, x in zip("RAS", place, strict=True))
    expected = f"{i}, {j}, {k} · {words} mm · value {SAMPLES[k, j, i]}"
    expect(page.locator("#slices [role=status]")).to_have_text(expected, timeout=WAIT)


def canvas(page, name):
    return page.locator(f"canvas[aria-label^={name}]")


def shows(page, plane, samples, cross):
    """Expect levels on a canvas, but where letters and the crosshair lie, in a row and a column."""
    (rows, columns), axes = samples.shape, {"Sagittal": (1, 2), "Coronal": (0, 2), "Axial": (0, 1)}[plane]
    asked = [columns, rows, *(SPACING[axis] for axis in axes)]
    is_plain = np.ones(samples.shape, bool)
    is_plain[cross[0]] = is_plain[:, cross[1]] = False
    is_plain[rows // 2] = is_plain[:, columns // 2] = False  # letters stand in the middles of sides
    for _ in range(50):
        levels = np.array(canvas(page, plane).evaluate(LEVELS, asked))
        if (levels == samples)[is_plain].all():
            return
        page.wait_for_timeout(100)
    raise AssertionError(f"{plane}: {levels}, expected {samples}")


def test_slices_beside_the_scene_show_the_samples_of_the_file_and_what_the_crosshair_is_at(
    chromium, scene_file
):
    with beside(chromium, scene_file) as page:
        axial = page.get_by_label("Axial slice, as a number")
        axial.fill("0")
        says(page, 3, 4, 0)
        shows(page, "Axial", EXPECTED["axial", 0], (4, 3))
        page.get_by_label("Sagittal slice", exact=True).fill("2")
        says(page, 2, 4, 0)
        shows(page, "Sagittal", EXPECTED["sagittal", 2], (4, 4))
        page.get_by_label("Coronal slice, as a number").fill("8")
        says(page, 2, 8, 0)
        shows(page, "Coronal", EXPECTED["coronal", 8], (4, 4))
        axial.fill("99")
        says(page, 2, 8, 0)


def test_wheel_keys_and_clicks_move_the_crosshair(chromium, scene_file):
    with beside(chromium, scene_file) as page:
        canvas(page, "Axial").hover()
        page.mouse.wheel(0, -100)
        says(page, 3, 4, 3)
        page.mouse.wheel(0, 100)
        page.mouse.wheel(0, 100)
        says(page, 3, 4, 1)
        canvas(page, "Coronal").press("PageUp")
        says(page, 3, 5, 1)
        for key, index in (("ArrowLeft", (4, 5, 1)), ("ArrowUp", (4, 5, 2)), ("PageDown", (4, 4, 2))):
            canvas(page, "Coronal").press(key)  # the patient's right is to the left, as radiologists have it
            says(page, *index)
        drag(page, canvas(page, "Sagittal"), (0.5, 0.5), (0.999, 0.999))
        says(page, 4, 0, 0)


def test_a_drag_changes_window_and_level_and_a_double_click_resets_them(chromium, scene_file):
    with beside(chromium, scene_file) as page:
        box = canvas(page, "Axial").bounding_box()
        page.mouse.move(box["x"] + 20, box["y"] + 20)
        page.mouse.down(button="right")
        page.mouse.move(box["x"] - 80, box["y"] + 20 - 30, steps=5)
        page.mouse.up(button="right")
        low, high = (
            float(page.get_by_label(f"Value that is {end}").input_value()) for end in ("black", "white")
        )
        assert high - low == pytest.approx(255 * np.exp(-100 / 300), rel=1e-3)
        assert (low + high) / 2 > 127.5 + 10
        says(page, *MIDDLE)
        shows(page, "Axial", windowed(SAMPLES[2, ::-1, ::-1], low, high), (4, 3))
        canvas(page, "Axial").dblclick()
        expect(page.get_by_label("Value that is white")).to_have_value("255")
        page.get_by_label("Value that is black").fill("300")
        page.keyboard.press("Enter")
        expect(page.get_by_text("Slices: expected black below white, got 300 and 255.")).to_be_visible()


def test_a_click_in_the_scene_moves_the_crosshair_to_what_is_seen(chromium, scene_file):
    scene, (u, v) = read_scene(scene_file), (0.52, 0.47)
    with beside(chromium, scene_file) as page:
        page.wait_for_timeout(500)
        box = page.locator("#picture").bounding_box()
        x, y = round(u * box["width"]), round(v * box["height"])
        page.mouse.click(box["x"] + x, box["y"] + y)
        camera = orbit(*PLACE.values(), round(box["width"]), round(box["height"]))
        median = Twin(scene).render(camera, scene, scene.open().palettes, outputs=("median",)).median
        point = camera.unproject(median)[y, x]
        place = place_at(open_grid(scene.volume.file), point.tolist())
        says(page, *place.index)
        marks = re.findall(r"-?[\d.]+", page.locator(".crosshair .line").get_attribute("d"))
        mark = np.array(marks, float).reshape(-1, 2).mean(axis=0)
        shown = camera.project(torch.tensor(point_of(place.index), dtype=torch.float32))[0]
        assert np.abs(mark - shown.numpy()).max() < 0.2
        drag(page, page.locator("#picture"), (0.3, 0.3), (0.4, 0.3))
        says(page, *place.index)


def test_a_tick_cuts_the_scene_at_the_crosshair_and_shows_the_slice_there(chromium, scene_file):
    with beside(chromium, scene_file) as page:
        page.get_by_label("Coronal slice", exact=True).fill("6")
        says(page, 3, 6, 2)
        page.get_by_label("In the scene").check()
        canvas(page, "Coronal").hover()
        page.mouse.wheel(0, -100)
        says(page, 3, 7, 2)
        expect(page.get_by_label("Faces")).to_have_value("slice")
        steps = page.locator("#steps li").all_inner_texts()
        assert set(steps) == {"cuts 1 plane, slice"}, "one, or two where the machine is slow"
        save_as(page, "cut.yaml")
        cuts = read_scene(scene_file.with_name("cut.yaml")).cuts
        assert (cuts.faces, list(cuts.window)) == ("slice", EVERYTHING)
        (plane,) = cuts.planes
        normal = np.array(plane.normal)
        camera = orbit(*PLACE.values(), 9, 9)
        assert np.abs(normal).tolist() == [0, 1, 0], "the volume lies in the world as in its file"
        assert normal @ camera.position.numpy() > plane.offset, "what is nearer is taken away"
        assert plane.offset == pytest.approx(normal @ point_of((3, 7, 2)))
        for _ in steps:
            page.get_by_role("button", name="Undo").click()
        expect(page.get_by_label("In the scene")).not_to_be_checked()
        page.get_by_label("In the scene").check()
        page.get_by_label("In the scene").uncheck()
        expect(page.get_by_label("Faces")).to_have_value("shaded")
        save_as(page, "whole.yaml")
        assert read_scene(scene_file.with_name("whole.yaml")).cuts == NO_CUTS


def test_only_a_scene_with_its_volume_has_slices(chromium, balls_file):
    with served(balls_file) as (_, address), opened(chromium, address) as page:
        expect(page.get_by_role("button", name="Slices", exact=True)).to_be_hidden()
