import numpy as np
import pytest
from PIL import Image

from texgs.core.errors import ArgumentError
from texgs.volume.contact_sheet import GUTTER, write_animation, write_contact_sheet


def greys(count, size=(30, 20)):
    return [Image.new("RGB", size, (10 * index,) * 3) for index in range(count)]


def test_sheet_shows_evenly_spaced_pictures_in_reading_order(tmp_path):
    pictures = greys(24, (90, 60))
    with Image.open(write_contact_sheet(tmp_path / "sheet.png", pictures, columns=3, thumbnail=60)) as sheet:
        assert (sheet.size, sheet.mode) == ((180 + 2 * GUTTER, 80 + GUTTER), "RGB")  # 2 rows of 3 of 60 x 40
        corners = [((60 + GUTTER) * (i % 3), (40 + GUTTER) * (i // 3)) for i in range(6)]
        shown = [np.unique(sheet.crop((x, y, x + 60, y + 40))) for x, y in corners]
        gutters = [np.unique(sheet.crop((x - GUTTER, 0, x, 40))) for x, y in corners[1:3]]
        gutters.append(np.unique(sheet.crop((0, 40, 180, 40 + GUTTER))))
    assert shown == [0, 40, 80, 120, 160, 200]
    assert gutters == [255] * 3


def test_pictures_smaller_than_a_thumbnail_stay_as_they_are(tmp_path):
    noise = Image.fromarray(np.random.default_rng(0).integers(0, 256, (20, 30, 3), np.uint8))
    with Image.open(write_contact_sheet(tmp_path / "sheet.png", [noise])) as sheet:
        np.testing.assert_array_equal(np.asarray(sheet), np.asarray(noise))
    large = Image.new("RGB", (60, 60), "red")
    with Image.open(write_contact_sheet(tmp_path / "sheet.png", [noise, large], thumbnail=40)) as sheet:
        np.testing.assert_array_equal(np.asarray(sheet.crop((5, 10, 35, 30))), np.asarray(noise))


def test_sheet_of_few_pictures_is_as_wide_as_they_are(tmp_path):
    with Image.open(write_contact_sheet(tmp_path / "sheet.png", greys(1), thumbnail=9)) as sheet:
        assert sheet.size == (9, 6)


def test_sheet_centres_pictures_of_other_aspects(tmp_path):
    red, blue = Image.new("RGB", (20, 10), "red"), Image.new("RGB", (10, 20), "blue")
    with Image.open(write_contact_sheet(tmp_path / "sheet.png", [red, blue], thumbnail=20)) as sheet:
        assert sheet.size == (40 + GUTTER, 20)
        assert sheet.getpixel((10, 10)) == (255, 0, 0)
        assert sheet.getpixel((30 + GUTTER, 10)) == (0, 0, 255)
        assert sheet.getpixel((10, 2)) == sheet.getpixel((22 + GUTTER, 10)) == (255, 255, 255)


@pytest.mark.parametrize("write", [write_contact_sheet, write_animation])
def test_transparent_pictures_lie_on_the_background(tmp_path, write):
    half = Image.new("RGBA", (16, 16), (0, 0, 0, 128))
    for background, expected in (("white", 127), ("#202020", 16)):
        with Image.open(write(tmp_path / "a.png", [half], background=background)) as picture:
            assert np.asarray(picture.convert("RGB")) == pytest.approx(expected, abs=1)


def test_animation_has_every_picture_and_repeats_without_end(tmp_path):
    pictures = greys(5)
    pictures[2] = pictures[2].convert("L")
    with Image.open(write_animation(tmp_path / "turn.png", pictures, milliseconds=50)) as animation:
        assert (animation.n_frames, animation.info["loop"], animation.size) == (5, 0, (30, 20))
        for index in range(5):
            animation.seek(index)
            assert animation.info["duration"] == 50
            assert animation.convert("RGB").getpixel((3, 3)) == (10 * index,) * 3


def test_mistakes_are_named_and_nothing_is_written(tmp_path):
    path = tmp_path / "a.png"
    with pytest.raises(ArgumentError, match=r"a\.png: expected at least one picture, got none"):
        write_contact_sheet(path, [])
    with pytest.raises(ArgumentError, match=r"a\.png: expected at least one picture, got none"):
        write_animation(path, [])
    with pytest.raises(ArgumentError, match="columns and thumbnail of at least 1, got 0 and 240"):
        write_contact_sheet(path, greys(1), columns=0)
    with pytest.raises(ArgumentError, match=r"pictures of one size, got \(30, 20\) and \(3, 2\) pixels"):
        write_animation(path, greys(2) + greys(1, (3, 2)))
    with pytest.raises(ArgumentError, match="milliseconds: expected at least 1 per picture, got 0"):
        write_animation(path, greys(2), milliseconds=0)
    with pytest.raises(ArgumentError, match="background: expected a colour name or #rrggbb, got 'wite'"):
        write_contact_sheet(path, greys(1), background="wite")
    assert not list(tmp_path.iterdir())
