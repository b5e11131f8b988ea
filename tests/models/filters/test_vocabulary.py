"""Wordings that are understood, and those that are not."""

import pytest

from texgs.core.errors import ArgumentError
from texgs.models.filters import FILTERS
from texgs.models.instruction import WORDS, named_color, understand, vocabulary

WORDINGS = {
    "stipple drawing": ("stipple drawing", "As a Stipple Drawing.", "draw it with stippling"),
    "pencil hatching": ("make it look like a cross-hatched pencil drawing", "a pencil sketch"),
    "woodcut": ("turn it into a woodcut",),
    "watercolour": ("a watercolor painting, please", "Watercolour"),
    "oil painting": ("make this an oil painting",),
    "cartoon": ("in the style of a cartoon",),
    "marble": ("make it a marble sculpture",),
    "wood": ("make it out of wood",),
    "glass": ("make it out of glass",),
    "gold": ("turn it into gold", "golden"),
    "silver": ("make it silver",),
    "colour blue": ("make it blue",),
    "colour dark red": ("make it dark red",),
    "colour #8040ff": ("change the color to #8040ff",),
}


@pytest.mark.parametrize("name", WORDINGS)
def test_usual_wordings(name):
    assert {understand(instruction)[0] for instruction in WORDINGS[name]} == {name}


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


def test_every_filter_has_words_and_is_understood_as_itself():
    assert list(FILTERS) == list(WORDS)
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
