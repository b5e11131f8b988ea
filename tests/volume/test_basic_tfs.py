from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.volume.functions import GREY, STEPS, TENT, functions
from texgs.core.errors import ArgumentError
from texgs.volume.basic_tfs import check_disjoint, combine, just_above, split
from texgs.volume.transfer import TransferFunction


class TestSplit:
    @given(functions(), st.lists(st.integers(-40, 40), min_size=2, max_size=6, unique=True))
    def test_equals_the_whole_inside_and_nothing_outside(self, tf, cuts):
        cuts = [cut / 4 for cut in sorted(cuts)]
        values = np.arange(-640, 640) / 64
        for low, high in pairwise(cuts):
            inside = (values > low) & (values < high)
            if not tf(values[inside])[:, 3].any():
                with pytest.raises(ArgumentError, match="expected a range with opacity above 0"):
                    split(tf, [(low, high)])
                continue
            (basic,) = split(tf, [(low, high)])
            whole, part = tf(values), basic(values)
            visible = inside & (whole[:, 3] > 0)  # the colour of what is transparent is free
            np.testing.assert_allclose(part[visible], whole[visible], rtol=0, atol=1e-12)
            np.testing.assert_array_equal(part[inside & ~visible][:, 3], 0)
            np.testing.assert_array_equal(part[(values < low) | (values > high)][:, 3], 0)

    def test_cuts_at_the_ends_with_the_limits_from_inside(self):
        left, right = split(STEPS, [(0, 1), (1, 2)])
        assert left.opacity == ((0, 0.2), (1, 0.4))
        assert left.color == ((0, 1, 0, 0), (1, 1, 0, 0))
        assert right.opacity == ((1, 0.9), (2, 0.75))
        assert right.color == ((1, 0, 1, 0), (2, 0, 0.5, 0.5))
        check_disjoint({"left": left, "right": right})

    def test_mistakes_are_named(self):
        with pytest.raises(ArgumentError, match=r"ranges\[1\]: expected low < high.*got \(3, 2\)"):
            split(TENT, [(1, 2), (3, 2)])
        with pytest.raises(ArgumentError, match=r"ranges\[0\] and ranges\[1\]: .*\(1, 3\) and \(2, 4\)"):
            split(TENT, [(1, 3), (2, 4)])
        with pytest.raises(ArgumentError, match=r"ranges\[0\]: .*got \(5, 6\); .* visible in \(1, 4\)"):
            split(TENT, [(5, 6)])


def test_overlap_names_both_functions_and_ranges():
    other = TransferFunction(((3.5, 0), (5, 1)), GREY)
    with pytest.raises(ArgumentError, match=r"TF01 and TF02: .*\(1, 4\) and \(3.5, 5\)"):
        check_disjoint({"TF01": TENT, "TF02": other})
    check_disjoint({"TF01": TENT, "TF02": TransferFunction(((4, 1), (5, 1)), GREY)})
    check_disjoint({})


@given(functions(), functions(), st.integers(0, 40))
def test_combined_functions_show_what_each_shows(first, second, apart):
    """Away from the ends of ranges, where steps may be, the sum of opacities is that of the one visible."""
    low, high = first.support
    moved = high - second.support[0] + apart / 4
    second = TransferFunction(
        tuple((value + moved, alpha) for value, alpha in second.opacity),
        tuple((value + moved, *rgb) for value, *rgb in second.color),
    )
    both = combine({"b": second, "a": first})
    ends = {value for tf in (first, second) for value, *_ in (*tf.opacity, *tf.color)}
    values = np.array([v for v in np.arange(low - 1, second.support[1] + 1, 0.0625) if v not in ends])
    for tf in (first, second):
        inside = (values > tf.support[0]) & (values < tf.support[1])
        np.testing.assert_allclose(both(values[inside]), tf(values[inside]), atol=1e-12)
    if apart:
        assert both(high)[3] == pytest.approx(first(high)[3], abs=1e-12), "also at its end"
    outside = ~np.any([(values > tf.support[0]) & (values < tf.support[1]) for tf in (first, second)], axis=0)
    assert (both(values[outside])[:, 3] == 0).all()


def test_functions_that_overlap_are_not_combined():
    with pytest.raises(ArgumentError, match="a and b: expected ranges of values that do not overlap"):
        combine({"a": TENT, "b": TENT})
    with pytest.raises(ArgumentError, match="transfer functions: expected at least one, got none"):
        combine({})


@pytest.mark.parametrize("value", [0.0, -0.0, 1e-45, -1e-40, 3e-33, 1.0, -255.0, 1e30])
def test_what_is_just_above_a_value_is_so_for_the_caster(value):
    """Which multiplies with the inverse of the difference, in single precision."""
    difference = np.float32(just_above(value)) - np.float32(value)
    assert 0 < difference <= max(1e-6 * abs(value), 2e-38)
    assert np.isfinite(np.float32(1) / difference)
