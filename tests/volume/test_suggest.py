import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.real_data import real_data
from tests.volume.volume_files import whole
from texgs.volume.axes import Channel
from texgs.volume.grid import Grid
from texgs.volume.prepare import prepare
from texgs.volume.slabs import ArraySource
from texgs.volume.suggest import suggest as of_summary
from texgs.volume.transfer import check_disjoint

RNG = np.random.default_rng(0)


def normal(*materials):
    """Voxels of materials (mean, standard deviation, count)."""
    return np.concatenate([RNG.normal(mean, deviation, count) for mean, deviation, count in materials])


CT = normal((-1000, 20, 500_000), (40, 60, 200_000), (1200, 150, 50_000)).clip(-1024, 2000)
AIR = normal((0, 5, 500_000), (100, 10, 100_000))


def suggest(counts, low, high, count=None, channel=None):
    """Functions for a histogram alone."""
    return of_summary({"histogram": counts, "minimum": low, "maximum": high}, count, channel)


def suggested(values, count=None):
    """Functions for the histogram of values, with what holds for every suggestion, and the range."""
    low, high = float(np.min(values)), float(np.max(values))
    counts = np.histogram(np.asarray(values, dtype=float), 256, (low, high))[0]
    return check(suggest(counts, low, high, count), low, high), low, high


def check(basic, low, high):
    check_disjoint(basic)
    assert list(basic) == [f"TF{i + 1:02d}" for i in range(len(basic))]
    slack = 1e-5 * (high - low)  # numbers are short
    ends = [(tf.support[0] + slack, tf.support[1] - slack) for tf in basic.values()]
    assert all(low <= first < last <= high for first, last in ends)
    supports = [tf.support for tf in basic.values()]
    assert supports == sorted(supports)
    peaks = [max(alpha for _, alpha in tf.opacity) for tf in basic.values()]
    assert peaks == sorted(peaks)
    assert len({tf.color[0][1:] for tf in list(basic.values())[:6]}) == min(len(basic), 6)
    return basic


LITTLE_NOISE = np.repeat([-1000, 50, 1200], [50_000, 30_000, 5000]) + RNG.normal(0, 8, 85_000).round()


def numbers_at(basic, value):
    """Numbers of the functions in which a value is at least half as opaque as it gets."""
    tfs = enumerate(basic.values(), start=1)
    return [n for n, tf in tfs if tf(value)[3] >= 0.5 * max(alpha for _, alpha in tf.opacity)]


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        (CT, {-1000: [], 40: [1], 1200: [2]}),
        (np.append(CT, RNG.normal(2600, 30, 3000)), {40: [1], 1200: [2], 2600: [3]}),
        (np.append(CT, np.full(5000, 2000)), {40: [1], 1200: [2], 2000: [3]}),
        (LITTLE_NOISE, {-1000: [], 50: [1], 1200: [2]}),
        (np.append(AIR, RNG.normal(-60, 10, 2000)), {-60: []}),
        (np.append(AIR, RNG.normal(-60, 10, 60_000)), {-60: [1], 0: [], 100: [2]}),
        (np.repeat([0, 1, 2, 7], [900, 50, 10, 2]), {0: [], 1: [1], 2: [2], 7: [3]}),
        (np.repeat([0, 1], [100, 400]), {0: [], 1: [1]}),
    ],
    ids=[
        "air, tissue, bone",
        "rare dense",
        "saturated",
        "little noise in few bins",
        "noise below air",
        "material below air",
        "labels",
        "mask",
    ],
)
def test_materials_and_labels_have_their_functions(values, expected):
    basic, _, _ = suggested(values)
    assert {value: numbers_at(basic, value) for value in expected} == expected


def test_the_scale_of_values_is_free():
    counts = np.histogram(CT, 256)[0]
    one, other = suggest(counts, -1024.0, 2000.0), suggest(counts, -1024e-6, 2000e-6)
    for a, b in zip(one.values(), other.values(), strict=True):
        np.testing.assert_allclose(np.array(a.support) * 1e-6, b.support)


FALLING = {
    "exponential": RNG.exponential(1, 300_000),
    "lognormal": RNG.lognormal(0, 0.5, 300_000),
    "mostly zero": np.append(np.zeros(500_000), RNG.exponential(1, 100_000)),
}


@pytest.mark.parametrize("values", FALLING.values(), ids=FALLING.keys())
def test_a_falling_histogram_becomes_three_shells(values):
    basic, _, _ = suggested(values)
    assert len(basic) == 3
    assert (values < basic["TF01"].support[0]).mean() > 0.7  # the shells do not fill the volume


def test_both_extremes_of_a_symmetric_field():
    basic, low, high = suggested(normal((0, 1, 300_000)))
    assert numbers_at(basic, 0) == []
    assert numbers_at(basic, 0.9 * low)
    assert numbers_at(basic, 0.9 * high)


def test_many_labels_are_grouped():
    labels = np.repeat(np.arange(25), 100)
    assert len(suggested(labels)[0]) == 5
    assert len(suggested(labels, count=24)[0]) == 24
    assert len(suggest([5, 0, 3], 0, 1, count=4)) == 1, "there are no more values"


@pytest.mark.parametrize("count", [1, 2, 5, 8])
@pytest.mark.parametrize("values", [CT, RNG.exponential(1, 10_000)], ids=["CT", "simulation"])
def test_the_count_is_kept(values, count):
    assert len(suggested(values, count)[0]) == count


@given(st.lists(st.integers(0, 10**6), min_size=40, max_size=300), st.none() | st.integers(1, 12))
def test_any_histogram(counts, count):
    if np.count_nonzero(counts) < 2:
        counts[0] = counts[-1] = 1
    basic = check(suggest(counts, -3.0, 5.0, count), -3.0, 5.0)
    assert 1 <= len(basic) <= (count or 5)


def test_real_volumes():
    basic, _, _ = suggested(whole(real_data("volumes/engine.vti")))  # its casing, and dense parts
    assert [numbers_at(basic, value) for value in (0, 140, 254)] == [[], [1], [len(basic)]]
    assert len(basic) > 1
    basic, _, _ = suggested(whole(real_data("volumes/tooth.nrrd")))  # dentin and enamel
    assert [numbers_at(basic, value) for value in (76, 163, 235)] == [[], [1], [2]]
    values = whole(real_data("volumes/hydrogen.vti"))
    basic, _, _ = suggested(values)
    assert len(basic) == 3
    assert (values >= basic["TF01"].support[0]).mean() < 0.05


@pytest.mark.parametrize(
    ("window", "opacity"),
    [
        ((20, 60), [(20, 0), (60, 0.3), (100, 0.3)]),
        ((-100, 150), [(0, 0.12), (100, 0.24)]),
        ((-20, 0), [(0, 0.3), (100, 0.3)]),
        ((50, 100), [(50, 0), (100, 0.3)]),
    ],
)
def test_a_channel_rises_over_its_window_within_the_data(window, opacity):
    counts, channel = np.histogram(AIR, 256, (0, 100))[0], Channel("GFP", (0, 1, 0.5), window)
    (tf,) = suggest(counts, 0, 100, channel=channel).values()
    np.testing.assert_allclose(tf.opacity, opacity)
    np.testing.assert_allclose(tf(window[1])[:3], (0, 1, 0.5))
    assert suggest(counts, 0, 100, 2, channel) == suggest(counts, 0, 100, 2)


def test_a_window_above_all_data_or_none_says_nothing():
    counts = np.histogram(AIR, 256, (0, 100))[0]
    for channel in (Channel("GFP", (0, 1, 0), (100, 200)), Channel("GFP")):
        assert suggest(counts, 0, 100, channel=channel) == suggest(counts, 0, 100)


SIZE = 48
RADII = np.sqrt(sum(np.square(axis - SIZE / 2) for axis in np.mgrid[:SIZE, :SIZE, :SIZE]))
CELLS = RNG.poisson(20, RADII.shape) + 80 * (RADII < 12)  # fluorescence of 5 to 130
BODY = np.where(RADII < 16, 40, -1000) + RNG.normal(0, 15, RADII.shape) + 700 * (RADII < 5)


@pytest.fixture
def of_volume(tmp_path):
    """Return functions for an array, with the note and the range of values that they are for."""

    def of_array(values, **options):
        source = ArraySource(Grid(values))
        summary = prepare(source, tmp_path / "volume.nrrd", **options)
        known = summary.robust or vars(summary)
        return of_summary(vars(summary)), source.note, (known["minimum"], known["maximum"])

    return of_array


@pytest.mark.parametrize("dtype", ["uint16", "float32"])
@pytest.mark.parametrize("outliers", [{(7, 8, 9): 65535, (20, 3, 30): 60000}, {(9, 40, 9): 1000}])
def test_outliers_do_not_change_what_is_suggested(of_volume, outliers, dtype):
    values = CELLS.astype(dtype)
    values[*np.transpose([*outliers])] = 20
    expected, note, _ = of_volume(values)
    assert note == ""
    for place, value in outliers.items():
        values[place] = value
    basic, note, _ = of_volume(values)
    assert basic == expected
    assert numbers_at(basic, 20) == []
    assert numbers_at(basic, 100)
    assert note.endswith(f"; outliers or padding, left out: {len(outliers)}")


@given(st.tuples(*3 * [st.integers(0, SIZE - 1)]), st.integers(300, 2**24) | st.integers(-(2**24), -150))
@settings(max_examples=20, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
def test_one_outlier_wherever_it_is_changes_nothing(of_volume, place, value):
    values = CELLS.astype(np.float32)
    values[place] = 20
    expected, _, _ = of_volume(values)
    values[place] = value
    assert of_volume(values)[0] == expected


def test_bright_parts_of_more_than_a_sample_are_no_outliers(of_volume):
    """However few they are: a bead, a fibre one sample thick, a label."""
    bead, fibre = CELLS.astype(np.uint16), CELLS.astype(np.uint16)
    bead[3, 3:5, 3:5] = fibre[3, 3, 10:30] = 4000
    labels = (RADII < 12).astype(np.uint8)
    labels[3, 3, 3] = 30
    for values in (bead, fibre, labels):
        basic, note, (_, highest) = of_volume(values)
        assert (highest, note) == (values.max(), "")
        assert numbers_at(basic, highest)


@pytest.mark.parametrize("share", [0.05, 0.3])
def test_an_object_that_is_saturated_is_no_background(share):
    """Its bin is the most frequent one."""
    values = np.append(RNG.normal(60, 15, 100_000), np.full(int(1e5 * share / (1 - share)), 255))
    basic, _, _ = suggested(values.clip(0, 255).round())
    assert [numbers_at(basic, value) for value in (45, 60, 75, 255)] == [[], [], [], [len(basic)]]


def test_an_even_background_at_the_upper_end_is_left_out():
    basic, _, _ = suggested(np.append(RNG.normal(100, 15, 20_000).round(), np.full(100_000, 255)))
    assert numbers_at(basic, 255) == []
    assert numbers_at(basic, 100)


@pytest.mark.parametrize("code", [-2000, -32768])
def test_padding_of_a_ct_changes_nothing(of_volume, code):
    corners = np.hypot(*np.mgrid[:SIZE, :SIZE] - SIZE / 2) > SIZE / 2 - 1
    values = BODY.round().astype(np.int16)
    values[:, corners] = code
    basic, note, (low, high) = of_volume(values)
    rest = values[values > code]
    assert (low, high) == (rest.min(), rest.max())
    assert [numbers_at(basic, value) for value in (code, -1000, 40, 740)] == [[], [], [1], [len(basic)]]
    left_out = f"outliers or padding, left out: {(values == code).sum()}"
    assert note == f"suggested functions are for [{low:g}, {high:g}]; {left_out}"


def test_an_organ_cut_out_of_a_ct_is_not_taken_for_air(of_volume):
    values = np.where(RADII < 16, BODY, -2000).round().astype(np.int16)
    basic, note, _ = of_volume(values)
    assert numbers_at(basic, 40)
    assert numbers_at(basic, -2000) == []
    assert note == ""


LUNG_CT = [
    ([-1000, 20, 45], [-850, 60, 20], [-90, 25, 8], [45, 20, 20], [300, 40, 2], [700, 200, 4], [-300, 40, 1]),
    ([-1000, 8, 45], [-870, 40, 20], [-90, 25, 8], [45, 20, 20], [300, 40, 2], [700, 200, 4], [-300, 40, 1]),
]


@pytest.mark.parametrize("materials", LUNG_CT, ids=["broad", "sharp"])
@pytest.mark.parametrize("kind", ["Hounsfield units", "from 0", "8 bit"])
def test_the_lung_of_a_ct_is_in_a_function_and_air_is_not(materials, kind):
    """Its peak is so near to that of air that a filter which keeps noise flat makes one of both."""
    change = {"Hounsfield units": (1, 0), "from 0": (1, 1024), "8 bit": (255 / 2400, 1000 * 255 / 2400)}
    scale, shift = change[kind]
    values = normal(*((mean, deviation, 10_000 * share) for mean, deviation, share in materials))
    values = (values.clip(-1000 if kind == "8 bit" else -1024, 1400) * scale + shift).round()
    basic, _, _ = suggested(values)
    places = [mean * scale + shift for mean, _, _ in materials]
    shown = [numbers_at(basic, place) for place in places]
    assert shown[0] == []
    assert all(shown[1:6])


@pytest.mark.parametrize("levels", [40, 77, 255])
@pytest.mark.parametrize("values", [RNG.lognormal(0, 0.5, 300_000), RNG.gamma(4, 1, 300_000)])
def test_bins_that_hold_no_whole_number_are_no_valleys(values, levels):
    """A peak of so few whole numbers is one peak: what is beside it is left out as of values between."""
    scaled = values / values.max() * levels
    (first, *_), (smooth, *_) = (suggested(each)[0].values() for each in (scaled.round(), scaled))
    assert first.support[0] == pytest.approx(smooth.support[0], abs=0.1 * levels)


def test_densities_over_decades_have_classes_of_their_logarithm(of_volume):
    """A cloud of 1e-24 in 1e-30: the functions reach far below the uppermost decade."""
    logs = -30 + 6 * np.exp(-np.square(RADII / 9)) + RNG.normal(0, 0.1, RADII.shape)
    basic, _, _ = of_volume((10**logs).astype(np.float32))
    ends = [np.log10(value) for tf in basic.values() for value in tf.support]
    assert -29.7 < ends[0] < -28
    assert ends[-1] == pytest.approx(logs.max(), abs=0.01)
    assert max(high - low for low, high in zip(ends[::2], ends[1::2], strict=True)) < 3


def test_values_of_two_decades_have_classes_of_their_own(of_volume):
    values = np.exp(-RADII / 10).astype(np.float32)
    basic, _, _ = of_volume(values)
    expected, _, _ = suggested(values)
    for tf, other in zip(basic.values(), expected.values(), strict=True):
        np.testing.assert_allclose(tf.opacity, other.opacity, rtol=1e-5)


def test_whole_numbers_that_float32_does_not_hold_are_told(of_volume):
    ids = np.arange(24).reshape(2, 3, 4).repeat(8, axis=2)
    message = "whole numbers above 16777216 are rounded, so that labels may become equal"
    assert of_volume(ids + 2**24)[1] == message
    assert of_volume(ids - 2**24 - 24)[1] == message
    assert of_volume(ids)[1] == of_volume((ids + 2**24).astype(np.float64))[1] == ""
