"""Pictures and films of a size that is chosen, without a background and as long as they should be."""

import io
from dataclasses import replace

import numpy as np
from PIL import Image

from tests.viewer.in_browser import WAIT, expect, opened, rendered, served, standalone
from texgs.cli.main import main
from texgs.scene.scene_file import read_scene, write_scene

SIZE = ("300", "200")


def saved_by(page, button):
    """Bytes of what a button of the dialog saves."""
    with page.expect_download(timeout=WAIT) as download:
        page.get_by_role("dialog").get_by_role("button", name=button).click()
    with open(download.value.path(), "rb") as file:  # noqa: PTH123
        return file.read()


def fill_size(page, size=SIZE):
    for label, side in zip(("Width, pixels", "Height, pixels"), size, strict=True):
        page.get_by_role("dialog").get_by_label(label).fill(side)


def test_a_picture_of_another_size_is_what_the_command_renders(chromium, scene_file):
    with served(scene_file) as (_, address), opened(chromium, address) as page:
        dialog = page.get_by_role("button", name="Picture of another size")
        dialog.click()
        box = page.locator("#picture").bounding_box()
        expect(page.get_by_role("dialog").get_by_label("Width, pixels")).to_have_value(f"{box['width']:g}")
        fill_size(page)
        size = ["--width", SIZE[0], "--height", SIZE[1]]
        assert saved_by(page, "Save picture") == rendered(scene_file, page, *size)
        dialog.click()
        fill_size(page)
        page.get_by_label("Transparent background").check()
        assert saved_by(page, "Save picture") == rendered(scene_file, page, *size, "--transparent")
        dialog.click()
        fill_size(page, ("300", "9000"))
        page.get_by_role("button", name="Save picture").click()
        expect(page.get_by_role("dialog")).to_be_visible()  # the browser says what is too large
        page.get_by_role("button", name="Cancel").click()
        page.get_by_label("Show", exact=True).select_option("alpha")
        dialog.click()
        expect(page.get_by_label("Transparent background")).to_be_disabled()


def test_a_film_has_a_size_and_a_length(chromium, scene_file):
    with served(scene_file) as (_, address), opened(chromium, address) as page:
        page.get_by_role("button", name="Export").click()
        page.get_by_role("dialog").get_by_label("As").select_option("points")
        expect(page.get_by_label("Length, seconds")).to_be_hidden()
        page.get_by_role("dialog").get_by_label("As").select_option("gif")
        expect(page.get_by_label("Length, seconds")).to_have_value("4")
        fill_size(page, ("60", "40"))
        page.get_by_label("Length, seconds").fill("0.5")
        page.get_by_label("Frames a second").fill("8")
        with Image.open(io.BytesIO(saved_by(page, "Export"))) as film:
            assert (film.size, film.n_frames) == ((60, 40), 4)


def test_the_standalone_page_saves_what_the_command_renders(chromium, scene_file, tmp_path):
    colored = write_scene(
        tmp_path / "colored.yaml", replace(read_scene(scene_file), background=(0.1, 0.3, 0.4))
    )
    output = tmp_path / "render.png"
    with standalone(chromium, colored, link="") as page:
        before = page.locator("#picture").screenshot()
        view = page.locator("#options").inner_text().split("--width")[0].split()[2:]
        page.get_by_role("button", name="Picture of another size").click()
        fill_size(page)
        page.get_by_label("Transparent background").check()
        made = np.asarray(Image.open(io.BytesIO(saved_by(page, "Save picture")))) / 255
        assert page.locator("#picture").screenshot() == before
    assert main(["render", str(colored), *view, "--width", SIZE[0], "--height", SIZE[1], "--transparent",
                 "--output", str(output)]) == 0  # fmt: skip
    expected = np.asarray(Image.open(output)) / 255
    premultiplied = [each[..., :3] * each[..., 3:] for each in (made, expected)]
    assert np.abs(made[..., 3] - expected[..., 3]).max() < 0.02  # surfels of the page are rounded
    assert np.abs(premultiplied[0] - premultiplied[1]).max() < 0.02
