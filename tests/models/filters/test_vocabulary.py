"""Wordings that are understood, and those that are not."""

import pytest

from texgs.core.errors import ArgumentError
from texgs.models.instruction import WORDS, named_color, understand, vocabulary


@pytest.mark.parametrize(
    ("instruction", "name"),
    [
        ("stipple drawing", "stipple drawing"),
        ("As a Stipple Drawing.", "stipple drawing"),
        ("draw it with stippling", "stipple drawing"),
        ("pencil hatching", "pencil hatching"),
        ("make it look like a cross-hatched pencil drawing", "pencil hatching"),
        ("a pencil sketch", "pencil hatching"),
        ("turn it into a woodcut", "woodcut"),
        ("a watercolor painting, please", "watercolour"),
        ("Watercolour", "watercolour"),
        ("make this an oil painting", "oil painting"),
        ("in the style of a cartoon", "cartoon"),
        ("make it a marble sculpture", "marble"),
        ("make it out of wood", "wood"),
        ("turn it into gold", "gold"),
        ("golden", "gold"),
        ("make it silver", "silver"),
        ("make it blue", "colour blue"),
        ("make it dark red", "colour dark red"),
        ("change the color to #8040ff", "colour #8040ff"),
    ],
)
def test_usual_wordings(instruction, name):
    assert understand(instruction)[0] == name


@pytest.mark.parametrize(
    "instruction",
    [
        "in the style of van Gogh",
        "marble and gold",
        "not gold",
        "make it",
        "a painting",
        "gold, darker",
        "#12",
    ],
)
def test_what_is_not_in_the_vocabulary_is_answered_by_it(instruction):
    with pytest.raises(ArgumentError) as caught:
        understand(instruction)
    message = str(caught.value)
    assert all(name in message for name in vocabulary())
    assert repr(instruction) in message


def test_every_entry_is_understood_as_itself():
    for name, words in WORDS.items():
        assert understand(name)[0] == name
        for word in words:
            assert understand(f"make it {word}")[0] == name


@pytest.mark.parametrize("instruction", ["", "  ", "\n", None, 3])
def test_empty_instructions(instruction):
    with pytest.raises(ArgumentError, match="expected what to do in words"):
        understand(instruction)


def test_colours_by_name():
    assert named_color("teal") == pytest.approx((0, 128 / 255, 128 / 255))
    assert named_color("#ff8000") == pytest.approx((1, 128 / 255, 0))
    assert named_color("colourless") is None
    assert named_color("0.5") is None  # a grey of matplotlib, but no name
