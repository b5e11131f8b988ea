"""Colours by name against the table of matplotlib."""

import re

import pytest
from hypothesis import given, strategies
from matplotlib.colors import CSS4_COLORS, to_rgb

from tests.refusals import refused
from texgs.core.colors import channels, color


@pytest.mark.parametrize("name", CSS4_COLORS)
def test_names_are_those_of_css(name):
    assert color("palette", name) == color("palette", name.title()) == pytest.approx(to_rgb(name))


@given(strategies.tuples(*3 * [strategies.integers(0, 255)]))
def test_hexadecimal_text_and_numbers_are_one_colour(rgb):
    shares = [each / 255 for each in rgb]
    assert color("tint", "#{:02x}{:02x}{:02x}".format(*rgb)) == color("tint", shares) == tuple(shares)


@pytest.mark.parametrize(
    ("value", "told"),
    [
        ("rde", "got 'rde', did you mean red?"),
        ("dark-red", "did you mean darkred?"),
        ("colourless", "got 'colourless'"),
        ("0.5", "got '0.5'"),  # a grey of matplotlib, but no name
        ("#ff88", "got '#ff88'"),
        ("#ff880080", "got '#ff880080'"),  # has alpha
        ("x" * 1000, "got 'xxx"),
        ([0, 0, 2], "got [0, 0, 2]"),
        ([True, 0, 0], "got [True, 0, 0]"),
        (None, "got None"),
    ],
)
def test_other_values_are_refused(value, told):
    expected = "palette: expected three numbers from 0 to 1, #rrggbb or the name of a colour, "
    refused(lambda: color("palette", value), f"{re.escape(expected)}.*{re.escape(told)}")


def test_text_that_is_no_colour_has_no_channels():
    assert channels("colourless") == channels("#") == channels("") == ()
