from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from texgs.core.figures import write_figure
from texgs.volume.grid import Grid
from texgs.volume.summaries import histogram
from texgs.volume.tf_plot import CAST_PIXELS, casts_of, plot
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


def balls():
    """Two balls side by side, of -100 and of 100."""
    z, y, x = np.mgrid[:20, :20, :40]
    left, right = ((x - middle) ** 2 + (y - 9.5) ** 2 + (z - 9.5) ** 2 < 64 for middle in (9.5, 29.5))
    return Grid((100.0 * right - 100.0 * left).astype(np.float32))


def test_casts_show_what_each_function_does_and_all_of_them(tmp_path):
    red = TransferFunction(((-100, 0.9), (-60, 0.9)), ((-100, 1, 0, 0),))
    blue = TransferFunction(((60, 0.9), (100, 0.9)), ((60, 0, 0, 1),))
    casts = casts_of(balls(), {"a$": red, "b": blue})
    assert list(casts) == ["a$", "b", "all"]
    assert all(
        cast.shape == (CAST_PIXELS, CAST_PIXELS, 3) and 0 <= cast.min() < cast.max() <= 1
        for cast in casts.values()
    )
    for channel, name, other in ((0, "a$", "b"), (2, "b", "a$")):
        seen = {
            key: int((cast[..., channel] > 1.5 * cast[..., 2 - channel]).sum()) for key, cast in casts.items()
        }
        assert seen[name] > 1000
        assert seen[other] == 0
        assert seen["all"] > 0.5 * seen[name]
    path = write_figure(
        tmp_path / "plot.png", plot({"": known([1, 2], -100, 100)}, {"a$": red, "b": blue}, casts=casts)
    )
    picture = Image.open(path)
    assert picture.size == (1000, 640)
    picture.crop((0, 450, 1000, 640)).save(tmp_path / "row.png")
    assert area(tmp_path / "row.png", (255, 255, 255), 10) < 190_000 - 2000


def test_a_robust_histogram_takes_the_place_of_the_whole_one():
    """Also on a logarithmic axis."""
    inner = {"minimum": 1e-6, "maximum": 1.0, "histogram": [5, 1, 2, 3], "scale": "log"}
    tf = TransferFunction(((1e-3, 0.0), (1.0, 0.5)), ((1e-3, 1, 0, 0),))
    for robust in (inner, {**inner, "minimum": 0, "scale": "linear"}):
        opacity, voxels = plot({"": {**known([9, 1], 0, 1e9), "robust": robust}}, {"TF": tf}).axes
        (stairs,) = voxels.patches
        heights, edges, _ = stairs.get_data()
        assert list(heights) == [5, 1, 2, 3]
        spaced = np.geomspace(1e-6, 1, 5) if robust is inner else np.linspace(0, 1, 5)
        np.testing.assert_allclose(edges, spaced)
        assert opacity.get_xscale() == robust["scale"]
        assert opacity.get_xlim()[1] < 1.1


def test_labels_share_a_panel_with_the_size_of_each():
    """In the unit of the file, cubed, where it has one."""
    lattice = {"space": {"unit": "mm"}, "spacing": (1, 2, 3)}
    sizes = {"label a": [40, 10, 20, 30], "label 7": [99, 0, 0, 1]}
    channels = {key: {**known(counts, 0, 255, "uint8"), **lattice} for key, counts in sizes.items()}
    step = TransferFunction(((127.5, 0.9), (255, 0.9)), ((127.5, 1, 0, 0),))
    tfs = {"a": step, "seven": replace(step, channel=1, color=((127.5, 0, 0, 1),))}
    (axes,) = plot(channels, tfs, "frog").axes
    assert [bar.get_width() for bar in axes.patches] == [6 * 1, 6 * 50], "the first is at the top"
    assert [bar.get_facecolor()[:3] for bar in axes.patches] == [(0, 0, 1), (1, 0, 0)]
    assert [text.get_text() for text in axes.get_yticklabels()] == ["seven", "a"]
    assert (axes.get_xlabel(), axes.get_title()) == ("mm\N{SUPERSCRIPT THREE}", "frog")
    casts = dict.fromkeys("abcdefgh", np.zeros((CAST_PIXELS, CAST_PIXELS, 3)))
    rows = plot(channels, tfs, casts=casts).axes[1:]
    assert [len(row.get_xticks()) for row in rows] == [6, 2]
    image = {"": known([1, 2, 3, 4], 0, 9), **channels}
    below = {name: replace(tf, channel=tf.channel + 1) for name, tf in tfs.items()} | {"TF01": BLUE}
    opacity, axes, _ = plot(image, below, "scan").axes
    assert [opacity.get_title(), axes.get_title(), len(axes.patches)] == ["scan", "", 2]
    channels["label a"]["space"]["unit"] = ""
    assert plot(channels, tfs).axes[0].get_xlabel() == "samples"
