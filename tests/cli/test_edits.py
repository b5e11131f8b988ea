"""Mistakes in an edit's configuration, told without its scene and without weights."""

import pytest

from texgs.config.compose import compose
from texgs.core.errors import ArgumentError, ConfigError, MissingDataError
from texgs.workflow.checks import check_edit, require_base


@pytest.mark.parametrize("edit", ["none", "style", "glass", "text", "gold", "crimson", "lobe"])
def test_edits_of_the_project_have_none(edit):
    check_edit(compose((f"edit={edit}",)))


@pytest.mark.parametrize(
    ("edit", "word", "message"),
    [
        ("style", "edit.image.style=nowhere.png", "one of strokes, glass, .*; got 'nowhere.png'"),
        ("glass", "edit.image.region=[[2, 0]]", "edit.image.region: expected two shares from 0 to below 1"),
        ("text", "edit.text.instruction=", "instruction: expected what to do in words"),
        ("gold", "edit.text.instruction=fur", "which needs guidance=instruct_pix2pix"),
        ("lobe", "edit.segment.name=", "edit.segment.name: expected a name without / . ="),
        ("lobe", "edit.segment.points=[]", "edit.segment.points: expected one at least"),
        ("lobe", "edit.segment.views=40", "views: expected 12, 42, 92"),
    ],
)
def test_one_sentence_for_each(edit, word, message):
    with pytest.raises(ArgumentError, match=message):
        check_edit(compose((f"edit={edit}", word)))


def test_what_an_edit_by_hand_starts_from_is_told_at_once(tmp_path):
    words = ("dataset=engine", "edit=crimson", f"results={tmp_path}")
    with pytest.raises(
        MissingDataError, match=r"edit\.base: lobe is not done yet; run texgs edit_segment edit=lobe"
    ):
        require_base(words)
    with pytest.raises(ConfigError, match=r"edit\.base: expected the file of a scene or one of"):
        require_base((*words, "edit.base=none-such"))
    with pytest.raises(ConfigError, match=r"edit\.parts: expected some of"):
        require_base(("dataset=engine", "edit=glass", "edit.parts=[nothing]"))
    require_base(("dataset=engine", "edit=glass"))
