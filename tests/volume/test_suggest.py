import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.real_data import real_data
from tests.volume.volume_files import whole
from texgs.volume.axes import Channel
from texgs.volume.suggest import suggest
from texgs.volume.transfer import check_disjoint

RNG = np.random.default_rng(0)


def normal(*materials):
    """Voxels of materials (mean, standard deviation, count)."""
    return np.concatenate([RNG.normal(mean, deviation, count) for mean, deviation, count in materials])


CT = normal((-1000, 20, 500_000), (40, 60, 200_000), (1200, 150, 50_000)).clip(-1024, 2000)
AIR = normal((0, 5, 500_000), (100, 10, 100_000))


def suggested(values, count=None):
    """Functions for the histogram of values, with what holds for every suggestion, and the range."""
    low, high = float(np.min(values)), float(np.max(values))
    counts = np.histogram(np.asarray(values, dtype=float), 256, (low, high))[0]
    return check(suggest(counts, low, high, count), low, high), low, high


def check(basic, low, high):
    check_disjoint(basic)
    assert list(basic) == [f"TF{i + 1:02d}" for i in range(len(basic))]
    assert all(low <= tf.support[0] < tf.support[1] <= high for tf in basic.values())
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


@pytest.mark.parametrize("count", range(1, 9))
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
