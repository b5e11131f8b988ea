import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from vtkmodules.vtkCommonDataModel import vtkPiecewiseFunction
from vtkmodules.vtkRenderingCore import vtkColorTransferFunction

from tests.volume.functions import GREY, STEPS, TENT, functions
from texgs.core.errors import ArgumentError
from texgs.volume.transfer import TransferFunction, check_disjoint, combine, just_above

RAMP = ((0, 0), (1, 1))


class TestEvaluation:
    @given(functions(), st.lists(st.floats(-9, 9), min_size=1))
    def test_equals_numpys_interpolation(self, tf, values):
        opacity, color = np.array(tf.opacity), np.array(tf.color)
        expected = [np.interp(values, color[:, 0], color[:, c]) for c in (1, 2, 3)]
        expected.append(np.interp(values, opacity[:, 0], opacity[:, 1], left=0, right=0))
        np.testing.assert_allclose(tf(values), np.stack(expected, -1), rtol=0, atol=1e-15)

    def test_a_step_takes_its_second_point_at_its_value(self):
        np.testing.assert_allclose(STEPS([math.nextafter(1, 0), 1])[:, 3], [0.4, 0.9])
        np.testing.assert_array_equal(STEPS([0.5, 1])[:, :3], [[1, 0, 0], [0, 1, 0]])

    def test_any_shape_and_dtype_and_missing_values_are_transparent(self):
        assert TENT(2.0).shape == (4,)
        assert TENT(np.zeros((2, 0, 3), np.float32)).shape == (2, 0, 3, 4)
        np.testing.assert_array_equal(TENT(np.uint8([2, 3])), TENT([2.0, 3.0]))
        np.testing.assert_array_equal(TENT([np.nan, np.inf, -np.inf])[:, 3], 0)

    @given(functions())
    def test_support_is_where_opacity_is(self, tf):
        low, high = tf.support
        values = np.arange(-1000, 1000) / 32 + 1 / 64  # off the grid of points
        alpha = tf(values)[:, 3]
        assert not alpha[(values < low) | (values > high)].any()
        inside = values[alpha > 0]
        assert low <= inside.min() < low + 1 / 16
        assert high - 1 / 16 < inside.max() <= high


class TestScaled:
    def test_fractions_become_values(self):
        tf = TransferFunction(((0, 0), (0.25, 1), (1, 0.5)), ((0, 0, 0, 0), (1, 1, 1, 1))).scaled(-1000, 3000)
        assert tf.opacity == ((-1000, 0), (0, 1), (3000, 0.5))
        assert [value for value, *_ in tf.color] == [-1000, 3000]
        with pytest.raises(ArgumentError, match=r"opacity\[1\]: expected a fraction .*got 2; do not scale"):
            TENT.scaled(0, 1)

    @given(st.floats(-1e6, 1e6), st.floats(1e-3, 1e6))
    def test_ends_are_exact(self, low, width):
        tf = TransferFunction(((0, 0), (1, 1)), GREY).scaled(low, low + width)
        assert tf.support == (low, low + width)


class TestWithoutSteps:
    @given(functions())
    def test_agrees_with_vtk_which_extends_the_ends(self, tf):
        opacity, color = vtkPiecewiseFunction(), vtkColorTransferFunction()
        for point in tf.without_steps().opacity:
            opacity.AddPoint(*point)
        for point in tf.without_steps().color:
            color.AddRGBPoint(*point)
        values = np.arange(-72, 73) / 8  # on the points and between them
        rgba = [(*color.GetColor(value), opacity.GetValue(value)) for value in values]
        np.testing.assert_allclose(rgba, tf(values), rtol=0, atol=1e-4)  # a step moves by 1e-6 of the range

    @given(functions())
    def test_is_strictly_ascending_and_ends_transparent(self, tf):
        assert TENT.without_steps() == TENT
        tf = tf.without_steps()
        assert (np.diff(np.array(tf.opacity)[:, 0]) > 0).all()
        assert (np.diff(np.array(tf.color)[:, 0]) > 0).all()
        assert tf.opacity[0][1] == tf.opacity[-1][1] == 0


class TestDictionary:
    @given(functions())
    def test_round_trip(self, tf):
        assert TransferFunction.from_dict(tf.to_dict()) == tf

    def test_numpy_and_integers_become_floats(self):
        tf = TransferFunction.from_dict({"opacity": np.array([[0, 0], [1, 1]]), "color": [[0, 1, 1, 1]]})
        assert tf.opacity == ((0.0, 0.0), (1.0, 1.0))
        assert type(tf.opacity[0][0]) is float
        assert hash(tf) == hash(TransferFunction.from_dict(tf.to_dict()))

    @pytest.mark.parametrize("data", [{}, {"opacity": []}, [1, 2], {"opacity": 1, "color": 1, "more": 1}])
    def test_wrong_keys(self, data):
        with pytest.raises(ArgumentError, match="expected the keys opacity, color, got"):
            TransferFunction.from_dict(data)


@pytest.mark.parametrize(
    ("opacity", "color", "message"),
    [
        (5, GREY, "opacity: expected a list of points"),
        ([(0, 1)], GREY, "at least 2 points, got 1"),
        ([(0, 0), (1, 0)], GREY, "expected some values with opacity above 0"),
        ([(0, 0), (2, 1), (1, 0)], GREY, r"opacity\[2\]: expected ascending values, got 1 after 2"),
        ([(0, 0), (1, 0), (1, 1), (1, 0)], GREY, r"opacity\[3\]: expected at most two points .* three at 1"),
        ([(0, 0), (1, 1.5)], GREY, r"opacity\[1\]: expected opacity in \[0, 1\], got \(1.5\)"),
        ([(0, 0), (math.nan, 1)], GREY, r"opacity\[1\]: expected finite numbers, got \(nan, 1\)"),
        ([(0, 0), (10**400, 1)], GREY, r"opacity\[1\]: expected finite numbers"),
        ([(0, 0), (1, "a")], GREY, r"opacity\[1\]: expected the numbers \(value, opacity\), got \(1, 'a'\)"),
        (RAMP, [], "color: expected at least 1 points, got 0"),
        (RAMP, [(0, 1, 1)], r"color\[0\]: expected the numbers \(value, r, g, b\), got \(0, 1, 1\)"),
        (RAMP, [(0, 1, 255, 1)], r"color\[0\]: expected r, g, b in \[0, 1\], got \(1, 255, 1\)"),
    ],
)
def test_wrong_points_are_named(opacity, color, message):
    with pytest.raises(ArgumentError, match=message):
        TransferFunction(opacity, color)


@pytest.mark.parametrize("within", ["", "1", False, 0.0, [], -1])
def test_a_mask_is_a_number(within):
    with pytest.raises(ArgumentError, match="within: expected a number from 0 on, got "):
        replace(TENT, within=within)


def test_overlap_names_both_functions_and_ranges():
    other = TransferFunction(((3.5, 0), (5, 1)), GREY)
    with pytest.raises(ArgumentError, match=r"TF01 and TF02: .*\(1, 4\) and \(3.5, 5\)"):
        check_disjoint({"TF01": TENT, "TF02": other})
    check_disjoint({"TF01": TENT, "TF02": TransferFunction(((4, 1), (5, 1)), GREY)})
    check_disjoint({})
    with pytest.raises(ArgumentError, match="a and b: expected ranges of values that do not overlap"):
        combine({"a": TENT, "b": TENT})
    with pytest.raises(ArgumentError, match="transfer functions: expected at least one, got none"):
        combine({})


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


@pytest.mark.parametrize("value", [0.0, -0.0, 1e-45, -1e-40, 3e-33, 1.0, -255.0, 1e30])
def test_what_is_just_above_a_value_is_so_for_the_caster(value):
    """Which multiplies with the inverse of the difference, in single precision."""
    difference = np.float32(just_above(value)) - np.float32(value)
    assert 0 < difference <= max(1e-6 * abs(value), 2e-38)
    assert np.isfinite(np.float32(1) / difference)
