import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.real_data import real_data
from texgs.volume.suggest import suggest
from texgs.volume.transfer import check_disjoint

RNG = np.random.default_rng(0)


def histogram(values, low=None, high=None):
    values = np.asarray(values, dtype=float)
    low, high = values.min() if low is None else low, values.max() if high is None else high
    return np.histogram(values, 256, (low, high))[0], float(low), float(high)


def normal(*materials):
    """Voxels of materials (mean, standard deviation, count)."""
    return np.concatenate([RNG.normal(mean, deviation, count) for mean, deviation, count in materials])


CT = normal((-1000, 20, 500_000), (40, 60, 200_000), (1200, 150, 50_000)).clip(-1024, 2000)


def check(basic, low, high):
    """What holds for every suggestion."""
    check_disjoint(basic)
    assert list(basic) == [f"TF{i + 1:02d}" for i in range(len(basic))]
    assert all(low <= tf.support[0] < tf.support[1] <= high for tf in basic.values())
    supports = [tf.support for tf in basic.values()]
    assert supports == sorted(supports)
    peaks = [max(alpha for _, alpha in tf.opacity) for tf in basic.values()]
    assert peaks == sorted(peaks)
    assert len({tf.color[0][1:] for tf in list(basic.values())[:6]}) == min(len(basic), 6)


def names_at(basic, value):
    """Names of the functions in which a value is at least half as opaque as it gets."""
    return [n for n, tf in basic.items() if tf(value)[3] >= 0.5 * max(alpha for _, alpha in tf.opacity)]


class TestMaterials:
    def test_air_soft_tissue_and_bone(self):
        basic = suggest(*histogram(CT))
        check(basic, CT.min(), CT.max())
        assert names_at(basic, -1000) == []
        assert names_at(basic, 40) == ["TF01"]
        assert names_at(basic, 1200) == ["TF02"]

    def test_a_rare_dense_material_is_found(self):
        values = np.append(CT, RNG.normal(2600, 30, 3000))
        basic = suggest(*histogram(values))
        assert [names_at(basic, v) for v in (40, 1200, 2600)] == [["TF01"], ["TF02"], ["TF03"]]

    def test_noise_below_the_background_is_left_out_but_not_a_material(self):
        air = normal((0, 5, 500_000), (100, 10, 100_000))
        assert names_at(suggest(*histogram(np.append(air, RNG.normal(-60, 10, 2000)))), -60) == []
        basic = suggest(*histogram(np.append(air, RNG.normal(-60, 10, 60_000))))
        assert [names_at(basic, v) for v in (-60, 0, 100)] == [["TF01"], [], ["TF02"]]

    def test_the_scale_of_values_and_counts_is_free(self):
        counts, low, high = histogram(CT)
        one, other = suggest(counts, low, high), suggest(counts, 1e-6 * low, 1e-6 * high)
        for a, b in zip(one.values(), other.values(), strict=True):
            np.testing.assert_allclose(np.array(a.support) * 1e-6, b.support)

    def test_the_maximum_is_visible(self):
        values = np.append(CT, np.full(5000, 2000))  # saturated
        basic = suggest(*histogram(values))
        assert names_at(basic, 2000) == [list(basic)[-1]]


FALLING = {
    "exponential": RNG.exponential(1, 300_000),
    "lognormal": RNG.lognormal(0, 0.5, 300_000),
    "mostly zero": np.append(np.zeros(500_000), RNG.exponential(1, 100_000)),
}


class TestSimulations:
    @pytest.mark.parametrize("values", FALLING.values(), ids=FALLING.keys())
    def test_a_falling_histogram_becomes_three_shells(self, values):
        counts, low, high = histogram(values)
        basic = suggest(counts, low, high)
        check(basic, low, high)
        assert len(basic) == 3
        assert (values < basic["TF01"].support[0]).mean() > 0.7  # the shells do not fill the volume

    def test_both_extremes_of_a_symmetric_field(self):
        counts, low, high = histogram(normal((0, 1, 300_000)))
        basic = suggest(counts, low, high)
        check(basic, low, high)
        assert names_at(basic, 0) == []
        assert names_at(basic, 0.9 * low)
        assert names_at(basic, 0.9 * high)


class TestLabels:
    def test_every_label_but_the_lowest_has_its_function(self):
        basic = suggest(*histogram(np.repeat([0, 1, 2, 7], [900, 50, 10, 2])))
        check(basic, 0, 7)
        assert [names_at(basic, label) for label in (0, 1, 2, 7)] == [[], ["TF01"], ["TF02"], ["TF03"]]

    def test_many_labels_are_grouped(self):
        counts, low, high = histogram(np.repeat(np.arange(25), 100))
        basic = suggest(counts, low, high)
        check(basic, low, high)
        assert len(basic) == 5
        assert len(suggest(counts, low, high, count=24)) == 24

    def test_a_mask(self):
        basic = suggest([100, 400], 0, 1)
        assert names_at(basic, 1) == ["TF01"]
        assert names_at(basic, 0) == []


class TestCount:
    @pytest.mark.parametrize("count", range(1, 9))
    @pytest.mark.parametrize("values", [CT, RNG.exponential(1, 10_000)], ids=["CT", "simulation"])
    def test_is_kept(self, values, count):
        counts, low, high = histogram(values)
        basic = suggest(counts, low, high, count)
        check(basic, low, high)
        assert len(basic) == count

    def test_is_limited_by_the_values(self):
        assert len(suggest([5, 0, 3], 0, 1, count=4)) == 1


@given(st.lists(st.integers(0, 10**6), min_size=40, max_size=300), st.none() | st.integers(1, 12))
def test_any_histogram(counts, count):
    if np.count_nonzero(counts) < 2:
        counts[0] = counts[-1] = 1
    basic = suggest(counts, -3.0, 5.0, count)
    check(basic, -3.0, 5.0)
    assert 1 <= len(basic) <= (count or 5)


def scalars(name):
    pyvista = pytest.importorskip("pyvista")
    mesh = pyvista.read(real_data(f"volumes/{name}"))
    return np.asarray(mesh.active_scalars if mesh.active_scalars is not None else mesh.point_data[0])


class TestRealVolumes:
    def test_engine_casing_and_dense_parts(self):
        basic = suggest(*histogram(scalars("engine.vti")))
        assert names_at(basic, 0) == []
        assert names_at(basic, 140) == ["TF01"]
        assert names_at(basic, 254) == [list(basic)[-1]] != ["TF01"]

    def test_tooth_dentin_and_enamel(self):
        basic = suggest(*histogram(scalars("tooth.nrrd")))
        assert [names_at(basic, v) for v in (76, 163, 235)] == [[], ["TF01"], ["TF02"]]

    def test_hydrogen_lobes(self):
        values = scalars("hydrogen.vti")
        basic = suggest(*histogram(values))
        assert len(basic) == 3
        assert (values >= basic["TF01"].support[0]).mean() < 0.05
