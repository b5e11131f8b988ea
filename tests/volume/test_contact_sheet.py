import numpy as np
import pytest
from PIL import Image

from texgs.volume.contact_sheet import GUTTER, MILLISECONDS, write_animation, write_contact_sheet


def greys(count, size=(30, 20)):
    return [Image.new("RGB", size, (8 * index,) * 3) for index in range(count)]


def test_sheet_shows_pictures_in_reading_order(tmp_path):
    with Image.open(write_contact_sheet(tmp_path / "sheet.png", greys(9, (360, 240)))) as sheet:
        across, down = 240 + GUTTER, 160 + GUTTER  # 2 rows of 6 of 240 x 160
        assert (sheet.size, sheet.mode) == ((6 * across - GUTTER, 2 * down - GUTTER), "RGB")
        corners = [(across * (i % 6), down * (i // 6)) for i in range(10)]
        shown = [np.unique(sheet.crop((x, y, x + 240, y + 160))) for x, y in corners]
        gutters = [np.unique(sheet.crop((x - GUTTER, 0, x, 160))) for x, y in corners[1:6]]
        gutters.append(np.unique(sheet.crop((0, 160, sheet.width, down))))
    assert shown == [*range(0, 72, 8), 255]
    assert gutters == [255] * 6


def test_pictures_smaller_than_a_thumbnail_stay_as_they_are(tmp_path):
    noise = Image.fromarray(np.random.default_rng(0).integers(0, 256, (20, 30, 3), np.uint8))
    with Image.open(write_contact_sheet(tmp_path / "sheet.png", [noise])) as sheet:
        np.testing.assert_array_equal(np.asarray(sheet), np.asarray(noise))
    large = Image.new("RGB", (360, 360), "red")
    with Image.open(write_contact_sheet(tmp_path / "sheet.png", [noise, large])) as sheet:
        np.testing.assert_array_equal(np.asarray(sheet.crop((105, 110, 135, 130))), np.asarray(noise))


def test_sheet_centres_pictures_of_other_aspects(tmp_path):
    red, blue = Image.new("RGB", (20, 10), "red"), Image.new("RGB", (10, 20), "blue")
    with Image.open(write_contact_sheet(tmp_path / "sheet.png", [red, blue])) as sheet:
        assert sheet.size == (40 + GUTTER, 20)
        assert sheet.getpixel((10, 10)) == (255, 0, 0)
        assert sheet.getpixel((30 + GUTTER, 10)) == (0, 0, 255)
        assert sheet.getpixel((10, 2)) == sheet.getpixel((22 + GUTTER, 10)) == (255, 255, 255)


@pytest.mark.parametrize("write", [write_contact_sheet, write_animation])
def test_transparent_pictures_lie_on_white(tmp_path, write):
    half = Image.new("RGBA", (16, 16), (0, 0, 0, 128))
    with Image.open(write(tmp_path / "a.png", [half])) as picture:
        assert np.asarray(picture.convert("RGB")) == pytest.approx(127, abs=1)


def test_animation_has_every_picture_and_repeats_without_end(tmp_path):
    pictures = greys(5)
    pictures[2] = pictures[2].convert("L")
    with Image.open(write_animation(tmp_path / "turn.png", pictures)) as animation:
        assert (animation.n_frames, animation.info["loop"], animation.size) == (5, 0, (30, 20))
        for index in range(5):
            animation.seek(index)
            assert animation.info["duration"] == MILLISECONDS
            assert animation.convert("RGB").getpixel((3, 3)) == (8 * index,) * 3
