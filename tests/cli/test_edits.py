"""Mistakes in an edit's configuration, told without its scene and without weights."""

import pytest

from texgs.cli.edits import check_edit
from texgs.config.compose import compose
from texgs.core.errors import ArgumentError


@pytest.mark.parametrize("edit", ["none", "style", "glass", "text", "gold", "crimson", "lobe", "lambda_50"])
def test_edits_of_the_project_have_none(edit):
    check_edit(compose((f"edit={edit}",)))


@pytest.mark.parametrize(
    ("edit", "word", "message"),
    [
        ("style", "edit.image.style=nowhere.png", "one of strokes, glass, .*; got 'nowhere.png'"),
        ("glass", "edit.image.region=[[2, 0]]", "edit.image.region: expected two shares from 0 to 1"),
        ("text", "edit.text.instruction=", "instruction: expected what to do in words"),
        ("gold", "edit.text.instruction=fur", "which needs the guidance instruct-pix2pix"),
        ("lobe", "edit.segment.name=", "edit.segment.name: expected a name without / . ="),
        ("lobe", "edit.segment.points=[]", "edit.segment.points: expected one at least"),
        ("lobe", "edit.segment.views=40", "views: expected 12, 42, 92"),
    ],
)
def test_one_sentence_for_each(edit, word, message):
    with pytest.raises(ArgumentError, match=message):
        check_edit(compose((f"edit={edit}", word)))
