"""Looks of a data set: what each basic scene follows in the edits of a whole experiment."""

import pytest

from texgs.config.compose import compose
from texgs.config.project import members
from texgs.core.errors import ConfigError
from texgs.models.instruction import understand
from texgs.models.pictures import PICTURES
from texgs.workflow.edits import captions, edited_scene, looks_of
from texgs.workflow.stage_table import STAGES


def test_an_edit_follows_its_own_picture_unless_it_asks_for_looks():
    config = compose(("dataset=engine", "edit=style"))
    assert looks_of(config) == {}
    assert captions(config)["target_caption"] == config.edit.target_caption
    config = compose(("dataset=engine", "edit=style", "edit.looks=true"))
    assert looks_of(config) == {"TF01": "waves", "TF02": "glass"}
    assert captions(config) == {
        "source_caption": "the casing of an engine and the pistons of an engine",
        "target_caption": "the casing of an engine as a print of waves and "
        "the pistons of an engine as stained glass",
    }


@pytest.mark.parametrize("edit", ["text_quick", "in2n_quick", "dge"])
def test_methods_by_words_follow_the_instruction(edit):
    config = compose(("dataset=engine", f"edit={edit}", "edit.looks=true"))
    assert looks_of(config) == {"TF01": "a watercolour", "TF02": "turn it into copper"}
    assert STAGES[f"edit_{config.edit.method}"].settings(config)["followed"] == looks_of(config)


def test_picture_files_of_looks_are_inputs(tmp_path):
    picture = tmp_path / "mine.png"
    picture.write_bytes(b"")
    words = ("dataset=engine", "edit=style", "edit.looks=true", f"dataset.looks.TF02.style={picture}")
    files = edited_scene(compose(words))
    assert files["style.TF02"] == picture
    assert "style.TF01" not in files, "texgs paints it"


def test_a_basic_tf_without_a_look_is_named():
    config = compose(("dataset=orbital", "edit=style", "edit.looks=true"))
    with pytest.raises(ConfigError, match=r"looks of orbital: expected a look for each of TF01, TF02"):
        looks_of(config)


@pytest.mark.parametrize(
    "name", [name for name in members("dataset") if compose((f"dataset={name}",)).dataset.looks]
)
def test_looks_that_are_there_can_be_made_without_weights(name):
    dataset = compose((f"dataset={name}",)).dataset
    for tf, look in dataset.looks.items():
        assert look.style in PICTURES
        understand(look.instruction)
        assert tf in dataset.basic_tfs or dataset.views_folder is not None
