import numpy as np
from PIL import Image

from tests.refusals import refused
from texgs.core.figures import CELL, DPI, FOOT, GAP, HEAD, LEFT, content, write_grid


def picture(rows, columns, size=(60, 80), value=0.2):
    """White with a grey block."""
    pixels = np.ones((*size, 3))
    pixels[rows, columns] = value
    return pixels


BLOCK = picture(slice(20, 30), slice(30, 40))


def test_a_row_for_each_name_and_a_column_for_each_title(tmp_path):
    rows = dict.fromkeys(("scene", "volume"), [BLOCK] * 3)
    path = write_grid(tmp_path / "a.png", rows, ["one", "two", "three"])
    width, height = Image.open(path).size
    assert width == round((LEFT + 3 * (CELL + GAP)) * DPI)
    assert height == round((GAP + HEAD + 2 * (CELL + GAP)) * DPI)
    again = write_grid(tmp_path / "b.png", rows, ["one", "two", "three"])
    assert path.read_bytes() == again.read_bytes()


def test_all_show_the_square_around_what_any_shows():
    pictures = [picture(slice(20, 24), slice(30, 34)), picture(slice(26, 30), slice(50, 54))]
    rows, columns = content(pictures)
    assert rows.stop - rows.start == columns.stop - columns.start == 24 + 8
    assert rows.start < 20 < 30 < rows.stop
    assert columns.start <= 30 < 54 <= columns.stop
    assert content([np.ones((4, 4, 3))]) == (slice(None), slice(None))


def test_places_may_be_empty_and_pictures_have_words_below(tmp_path):
    rows, titles = {"a": [BLOCK, None], "b": [None, BLOCK]}, ["one", "two"]
    plain = write_grid(tmp_path / "plain.png", rows, titles)
    noted = write_grid(tmp_path / "noted.png", rows, titles, {"a": ["", ""], "b": ["", "31.2 dB"]})
    (width, height), (_, higher) = Image.open(plain).size, Image.open(noted).size
    assert higher - height == round((FOOT - GAP) * DPI)
    pixels = np.asarray(Image.open(plain).convert("L"))
    right = pixels[70 : height // 2 - 20, width // 2 + 20 :]
    assert right.min() == 255, "nothing is drawn in the empty place"
    assert pixels[70 : height // 2 - 20, 20 : width // 2 - 20].min() < 100
    refused(lambda: write_grid(tmp_path / "a.png", rows, ["one", "two", "three"]), "a: .*3 pictures, got 2")
