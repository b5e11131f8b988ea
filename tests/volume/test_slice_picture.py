"""Pictures of slices: grey samples as square pixels, labels, crosshair and words."""

from dataclasses import replace

import numpy as np
import pytest

from tests.refusals import refused
from tests.scene.labelled import BLUE, RED, hill, labelled_scene, labels
from texgs.scene.session import Session
from texgs.volume.nrrd_file import open_grid
from texgs.volume.slice_keys import SliceKeys
from texgs.volume.slice_picture import CROSS, sample_at, words_at
from texgs.volume.slices import point_of, window_of, windowed

LINE = tuple(bytes.fromhex(CROSS[1:]))
WINDOW = (0.0, 200.0)


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return labelled_scene(tmp_path_factory.mktemp("scan"))


def samples_of(picture, columns, rows, width, height):
    """The colours [rows, columns, 3] in the middles of the samples of a slice, a little off the crosshair."""
    x = ((np.arange(columns) + 0.3) * width / columns).astype(int)
    y = ((np.arange(rows) + 0.3) * height / rows).astype(int)
    return picture[y][:, x]


def test_a_slice_has_square_pixels_with_labels_over_grey(scene):
    """From the feet: x to the left of the patient is right, y to the front is up."""
    picture = Session(scene).slices(SliceKeys("axial", 10, window=WINDOW, width=450))
    height = round(450 * 26 * 1.0 / (31 * 1.5))
    assert picture.shape[1] == 450
    seen = samples_of(picture[:height], 31, 26, 450, height).astype(int)
    grey = windowed(hill()[10, ::-1], *WINDOW).astype(int)
    numbers = labels()[10, ::-1]
    expected = np.repeat(grey[..., None], 3, axis=2).astype(float)
    for number, color in ((1, RED), (2, BLUE)):
        expected[numbers == number] = 0.4 * expected[numbers == number] + 0.6 * 255 * np.array(color)
    is_text = np.zeros((26, 31), bool)  # and letters of the ends
    is_text[:3, 13:18] = is_text[-3:, 13:18] = is_text[11:15, :3] = is_text[11:15, -3:] = True
    assert np.abs(seen - expected)[~is_text].max() <= 1


def test_the_crosshair_meets_at_the_sample(scene):
    picture = Session(scene).slices(SliceKeys("axial", at=(-4.0, -3.0, 55.0), window=WINDOW, width=620))
    height = round(620 * 26 / 46.5)
    (row,) = np.flatnonzero((picture[:height, 3:200] == LINE).all(-1).all(1))
    (column,) = np.flatnonzero((picture[60:140] == LINE).all(-1).all(0))
    assert (int(column / 620 * 31), int(row / height * 26)) == (4, 26 - 1 - 8)


def test_colours_are_those_of_the_scene_and_hidden_labels_are_grey(scene):
    session, keys = Session(scene), SliceKeys("axial", 10, window=WINDOW, width=450)
    places = ((100, 155), (100, 360))  # row and column, in the first and the second label
    before = session.slices(keys)
    session.set("blue", "visible", False)
    session.set("red", "palette", (0.0, 1.0, 0.0))
    after = session.slices(keys)
    assert len({*map(int, after[places[1]])}) == 1
    assert len({*map(int, before[places[1]])}) > 1
    assert after[places[0]][1] > 150 > before[places[0]][1]


def test_labels_without_an_image_are_on_black(tmp_path):
    session = Session(labelled_scene(tmp_path, with_image=False))
    picture = session.slices(SliceKeys("axial", 10, width=450))
    height = round(450 * 26 * 1.0 / (31 * 1.5))
    seen = {tuple(each) for each in samples_of(picture[:height], 31, 26, 450, height).reshape(-1, 3)}
    colors = {tuple(round(255 * x) for x in color) for color in (RED, BLUE)}
    assert colors | {(0, 0, 0)} <= seen
    session.set("red", "visible", False)
    hidden = session.slices(SliceKeys("axial", 10, width=450))
    assert tuple(hidden[100, 155]) == (0, 0, 0)
    grid, known = open_grid(session.scene.volume.file), {"bone": (0, None), "vessel": (1, None)}
    assert words_at(grid, point_of(grid, (5, 13, 10)), known) == "L -2.5, P -7, S 52 mm; bone"


def test_all_three_are_side_by_side_in_one_scale(scene):
    """26 mm, 46.5 mm and 46.5 mm wide; the tallest is the axial one, the others are as tall as each other."""
    picture = Session(scene).slices(SliceKeys(window=(-1e3, 1e3), width=900))  # no sample is black
    scale = (900 - 12) / (26 + 46.5 + 46.5)
    is_black = (picture == 0).all(-1)
    (gaps,) = np.nonzero(is_black[: round(26 * scale)].all(0))
    assert gaps == pytest.approx(
        [26 * scale + i for i in range(6)] + [72.5 * scale + 6 + i for i in range(6)], abs=1
    )
    middles = [round(x * scale) for x in (20, 60, 100)]
    heights = [int((~is_black[: round(26 * scale), x]).sum()) for x in middles]
    assert heights == pytest.approx([24 * scale, 24 * scale, 26 * scale], abs=1)


def test_words_say_index_place_value_and_label(scene):
    grid = open_grid(scene.volume.file)
    known = {"bone": (1, None), "vessel": (2, None)}
    point = point_of(grid, (5, 9, 8))  # y is counted to the back
    value = hill()[8, 26 - 1 - 9, 5]
    assert words_at(grid, point, known) == f"L -2.5, P -11, S 49.6 mm; value {value}; bone"
    assert (
        words_at(grid, point_of(grid, (0, 0, 0)), known) == f"L -10, P -20, S 40 mm; value {hill()[0, 25, 0]}"
    )


def test_a_place_is_that_of_the_file(scene):
    grid = open_grid(scene.volume.file)
    place = sample_at(grid, (-10 + 1.5 * 7 + 0.6, 5 - 3.4, 40 + 1.2 * 12))
    assert (place.index, place.value) == ((7, 25 - 3, 12), hill()[12, 3, 7])
    assert place.position == pytest.approx((0.5, 2.0, 54.4))
    assert sample_at(grid).index == (15, 12, 10) or sample_at(grid).index == (15, 13, 10)


def test_mistakes_are_one_sentence(scene):
    session = Session(scene)
    for keys, words in (
        (SliceKeys("x", 3), "slice: expected all, or a number of sagittal, coronal, axial, got x"),
        (SliceKeys("all", 3), "slice: expected all, or a number of sagittal, coronal, axial, got all"),
        (SliceKeys("axial", 20), "slice: expected axial from 0 to 19, got 20"),
        (SliceKeys(at=(0, 0, 0)), r"at: expected a place in the volume, from \[-10.0, 5.0, 40.0\] to"),
    ):
        refused(lambda keys=keys: session.slices(keys), words)
    refused(lambda: SliceKeys(window=(200, 0)), r"window: expected black below white, got \[200, 0\]")
    bare = Session(replace(scene, volume=None))
    refused(lambda: bare.slices(SliceKeys()), "volume: expected the volume that the scene was made from")


def test_a_window_leaves_out_a_hundredth_of_the_samples(scene):
    grid = open_grid(scene.volume.file)
    assert window_of(grid) == tuple(np.quantile(hill(), (0.005, 0.995)))
    flat = replace(
        grid, values=np.where(np.arange(SIZE := hill().size).reshape(hill().shape) < SIZE - 3, 5, 9)
    )
    assert window_of(flat) == (5, 9)
