"""Wordings that are understood, and those that are not."""

import re

import pytest

from tests.refusals import refused
from texgs.core.errors import ArgumentError
from texgs.models.filters import FILTERS
from texgs.models.instruction import WORDS, understand, vocabulary

WORDINGS = {
    **{name: (f"make it {name}", f"make it of {name}.") for name in ("marble", "wood", "glass", "silver")},
    "stipple drawing": ("stipple drawing", "As a Stipple Drawing.", "draw it with stippling"),
    "pencil hatching": ("make it look like a cross-hatched pencil drawing", "a pencil sketch"),
    "woodcut": ("turn it into a woodcut",),
    "watercolour": ("a watercolor painting, please", "Watercolour"),
    "oil painting": ("make this an oil painting",),
    "cartoon": ("in the style of a cartoon",),
    "gold": ("turn it into gold", "golden"),
    "colour dark red": ("make it dark red",),
    "colour #8040ff": ("change the color to #8040ff",),
}


@pytest.mark.parametrize("name", WORDINGS)
def test_usual_wordings(name):
    assert {understand(instruction)[0] for instruction in WORDINGS[name]} == {name}


STRANGE = (
    "in the style of van Gogh",
    "marble and gold",
    "not gold",
    "make it",
    "a painting",
    "gold, darker",
    "#12",
)


@pytest.mark.parametrize("instruction", STRANGE)
def test_what_is_not_in_the_vocabulary_is_answered_by_it(instruction):
    with pytest.raises(ArgumentError, match=re.escape(repr(instruction))) as caught:
        understand(instruction)
    assert all(name in str(caught.value) for name in vocabulary())


def test_every_filter_has_words_and_is_understood_as_itself():
    assert list(FILTERS) == list(WORDS)
    for name, words in WORDS.items():
        assert understand(name)[0] == name
        for word in words:
            assert understand(f"make it {word}")[0] == name


@pytest.mark.parametrize("instruction", ["", "  ", "\n", None, 3])
def test_empty_instructions(instruction):
    refused(lambda: understand(instruction), "what to do in words")
