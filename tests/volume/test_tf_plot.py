import numpy as np
import pytest
from PIL import Image

from texgs.core.figures import write_figure
from texgs.volume.tf_plot import plot
from texgs.volume.transfer import TransferFunction

pytest.importorskip("matplotlib")

RED = TransferFunction(((0, 0), (1, 0.5), (2, 0.5), (3, 0)), ((0, 1, 0, 0),))
BLUE = TransferFunction(((4, 1), (6, 1)), ((0, 0, 0, 1),))


def written(path, *values):
    """Write the figure of some values; returns its path."""
    return write_figure(path, plot(*values))


def area(path, color, tolerance=60):
    """Number of pixels near a colour."""
    pixels = np.asarray(Image.open(path).convert("RGB")).astype(int)
    return int((abs(pixels - np.array(color)).max(axis=-1) < tolerance).sum())


def test_areas_are_as_large_as_opacity_times_range(tmp_path):
    path = written(tmp_path / "a" / "plot.png", np.ones(10), 0, 10, {"TF01": RED, "TF02": BLUE}, "engine")
    assert Image.open(path).size == (1000, 450)
    assert area(path, (255, 38, 38)) / area(path, (38, 38, 255)) == pytest.approx(1 / 2, rel=0.05)


def test_the_histogram_is_grey_and_logarithmic(tmp_path):
    grey = (209, 209, 209)
    small = area(written(tmp_path / "1.png", [1e1, 1e5], 0, 1, {}), grey, 5)
    large = area(written(tmp_path / "2.png", [1e5, 1e5], 0, 1, {}), grey, 5)
    assert 0.5 < small / large < 0.75  # linear: 0.5


def test_functions_beyond_the_data_are_in_the_picture_and_titles_are_no_mathematics(tmp_path):
    path = written(tmp_path / "plot.png", [1, 2, 3], 0, 1, {"$x_{$": BLUE}, "$\\frac{$ 5 $")
    assert area(path, (38, 38, 255)) > 5000


def test_pyplot_is_left_alone(tmp_path):
    import sys

    before = "matplotlib.pyplot" in sys.modules
    written(tmp_path / "plot.png", [1], 0, 1, {})
    assert ("matplotlib.pyplot" in sys.modules) == before
