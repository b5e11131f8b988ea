from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from texgs.core.figures import write_figure
from texgs.volume.summaries import histogram
from texgs.volume.tf_plot import plot
from texgs.volume.transfer import TransferFunction

pytest.importorskip("matplotlib")

RED = TransferFunction(((0, 0), (1, 0.5), (2, 0.5), (3, 0)), ((0, 1, 0, 0),))
BLUE = TransferFunction(((4, 1), (6, 1)), ((0, 0, 0, 1),))


def known(histogram, minimum, maximum, dtype="float32"):
    """What a plot reads of the summary of a channel."""
    return {"dtype": dtype, "minimum": minimum, "maximum": maximum, "histogram": histogram}


def written(path, histogram, minimum, maximum, *values):
    """Write the figure of one channel; returns its path."""
    summary = known(histogram, minimum, maximum)
    return write_figure(path, plot({"": summary}, *values))


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


@pytest.mark.parametrize(
    ("first", "count", "dtype"), [(0, 4, "uint8"), (-7, 250, "int16"), (0, 257, "uint16"), (3, 301, "int32")]
)
def test_bins_of_integers_are_level_where_values_are_equally_frequent(first, count, dtype):
    """There are 256 of them, which would hold no, one or two integers."""
    values = np.arange(first, first + count, dtype=dtype).repeat(5)
    counts = histogram(values, first, first + count - 1)
    figure = plot({"": known(counts, first, first + count - 1, dtype)}, {})
    opacity, voxels = figure.axes
    (stairs,) = voxels.patches
    heights, edges, _ = stairs.get_data()
    assert heights == pytest.approx(5 * count / min(count, 256))
    assert (edges[0], edges[-1]) == (first - 0.5, first + count - 0.5)
    assert len(heights) == min(count, 256)
    low, high = opacity.get_xlim()
    assert low < edges[0] < edges[-1] < high


def test_functions_beyond_the_data_are_in_the_picture_and_titles_are_no_mathematics(tmp_path):
    path = written(tmp_path / "plot.png", [1, 2, 3], 0, 1, {"$x_{$": BLUE}, "$\\frac{$ 5 $")
    assert area(path, (38, 38, 255)) > 5000


def test_each_channel_has_its_histogram_and_its_functions(tmp_path):
    """The lower half has twice as many values, of which the function covers half as much."""
    ends = {"a": 10, "b": 20}
    channels = {label: known([1, 9], 0, high) for label, high in ends.items()}
    functions = {"red": RED, "blue": replace(BLUE, channel=1)}
    path = write_figure(tmp_path / "plot.png", plot(channels, functions, "x"))
    picture = Image.open(path)
    assert picture.size == (1000, 900)
    for part, (top, bottom) in {"upper": (0, 450), "lower": (450, 900)}.items():
        picture.crop((0, top, 1000, bottom)).save(tmp_path / f"{part}.png")
    red, blue = (255, 38, 38), (38, 38, 255)
    assert area(tmp_path / "upper.png", blue) == area(tmp_path / "lower.png", red) == 0
    ratio = area(tmp_path / "lower.png", blue) / area(tmp_path / "upper.png", red)
    assert ratio == pytest.approx(2 / 2, rel=0.05)


def test_pyplot_is_left_alone(tmp_path):
    import sys

    before = "matplotlib.pyplot" in sys.modules
    written(tmp_path / "plot.png", [1], 0, 1, {})
    assert ("matplotlib.pyplot" in sys.modules) == before
