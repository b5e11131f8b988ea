"""What looks were given stands beside them: transfer functions, pictures as they are, and words."""

import json

import numpy as np
import pytest
from PIL import Image

from texgs.core.figures import write_grid
from texgs.report.given_row import SIDE, given_row, tf_plot
from texgs.volume.transfer import TransferFunction

RED = TransferFunction(((0, 0), (1, 0.5), (2, 0.5), (3, 0)), ((0, 1, 0, 0),))
BLUE = TransferFunction(((4, 1), (6, 1)), ((0, 0, 0, 1),))


@pytest.fixture
def volume(tmp_path):
    summary = {"dtype": "float32", "minimum": 0.0, "maximum": 10.0, "histogram": [1.0] * 10}
    (tmp_path / "volume.json").write_text(json.dumps(summary))
    return tmp_path / "volume.nrrd"


def test_pictures_keep_their_shape_and_come_from_the_edit_that_wrote_them(tmp_path):
    scenes = [tmp_path / name / "scene.yaml" for name in ("fitted", "styled")]
    for scene in scenes:
        scene.parent.mkdir()
    for name, size in (("TF01", (40, 20)), ("TF02", (20, 40))):
        Image.new("RGB", size, "red").save(tmp_path / "styled" / f"style-{name}.png")
    row = given_row(None, {"TF01": "waves", "TF02": "photos/sea.jpg"}, {}, scenes)
    assert [cell.title for cell in row.cells] == ["TF01: waves", "TF02: sea"]
    for cell, share in zip(row.cells, ((1, 0.5), (0.5, 1)), strict=True):
        red = cell.pixels[..., 1] == 0
        assert cell.pixels.shape == (SIDE, SIDE, 3)
        assert (red.any(0).mean(), red.any(1).mean()) == pytest.approx(share, abs=0.01)


def test_one_picture_for_all_is_shown_for_each(tmp_path):
    Image.new("RGB", (4, 4), "red").save(tmp_path / "style.png")
    row = given_row(None, dict.fromkeys(("TF01", "TF02"), "waves"), {}, [tmp_path / "scene.yaml"])
    assert all((cell.pixels == (255, 0, 0)).all() for cell in row.cells)
    assert not given_row(None, {"TF01": "waves"}, {}, [tmp_path / "other" / "scene.yaml"]).cells


def test_instructions_are_words_in_short_lines():
    text = "make it look like a very old copper engraving"
    (cell,) = given_row(None, {}, {"TF01": text}, []).cells
    assert (cell.title, cell.words.replace("\n", " ")) == ("TF01", f"“{text}”")
    assert max(map(len, cell.words.splitlines())) <= 18


def test_transfer_functions_come_first_with_their_colours(volume, tmp_path):
    plot = tf_plot(volume, {"TF01": RED, "TF02": BLUE})
    assert plot.shape == (SIDE, SIDE, 3)
    red, blue = (
        (abs(plot.astype(int) - color).max(-1) < 60).sum() for color in ((255, 38, 38), (38, 38, 255))
    )
    assert red / blue == pytest.approx(1 / 2, rel=0.1)
    row = given_row(plot, {}, {"TF01": "gold"}, [])
    assert [cell.title for cell in row.cells] == ["transfer functions", "TF01"]
    views = {"front": [np.zeros((8, 8, 3))] * 2}
    heights = [
        Image.open(write_grid(tmp_path / "grid.png", views, ["a", "b"], None, more)).height
        for more in ((), [row])
    ]
    assert heights[1] > 2 * heights[0] - 100, "below the views"
