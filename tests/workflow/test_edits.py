"""The edits of an experiment: what each starts from, which stages it goes through, and what it reads."""

import pytest

from texgs.config.compose import compose
from texgs.config.project import members
from texgs.core.errors import ConfigError
from texgs.workflow.edits import edits
from texgs.workflow.stage_table import STAGES


def edits_of(*words):
    return [compose(each).edit for each in edits(words)]


def test_every_edit_of_conf_composes_and_is_named_after_its_file():
    for name in members("edit"):
        edit = compose(("dataset=engine", f"edit={name}")).edit
        assert edit.name == name
        assert (edit.method == "none") == (name == "none")
        assert edit.base is None or edit.base in members("edit")


@pytest.mark.parametrize(
    ("words", "names"),
    [
        (("dataset=engine",), []),
        (("edit=crimson",), ["lobe", "crimson"]),  # what an edit starts from comes before it
        (("edits=[glass, crimson, lobe]",), ["glass", "lobe", "crimson"]),
    ],
)
def test_edits_of_a_run(words, names):
    assert [edit.name for edit in edits_of(*words)] == names


def test_words_hold_for_the_edit_and_its_base_and_parts_can_be_given():
    words = ("edit=glass", "edit.base=lobe", "edit.parts=[TF02/lobe]", "edit.name=part")
    lobe, part = edits_of(*words, "edit.image.iterations=7")
    assert (lobe.name, lobe.method, lobe.base, list(lobe.parts)) == ("lobe", "segment", None, [])
    assert (part.name, part.method, part.base, list(part.parts)) == ("part", "image", "lobe", ["TF02/lobe"])
    assert part.image.iterations == 7


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("edits=[glass, glass]",), "edits: expected different names, got glass twice"),
        (("edits=[glas]",), "edit: expected one of .*crimson, .*glass, "),
        (("edit=glass", "edit.base=glass"), "edit.base: glass starts from itself"),
        (("edit=glass", "edit.base=lobes"), "edit.base: expected the file of a scene or one of .* mean lobe"),
        (("edit=glass", "edit.parts=[TF09]"), "edit.parts: expected some of TF01, .*, got TF09"),
        (("edit=glass", "edit.base=lobe", "edit.parts=[TF02/lob]"), "got TF02/lob, did you mean TF02/lobe"),
        (("edit=lobe", "edit.segment.model=TF09"), "edit.segment.model: expected one of TF01, .*, got TF09"),
        (("edit=glass", "edit.image.lambda_s=1.5"), "edit.image.lambda_s: expected at most 1, got 1.5"),
        (("edit=glass", "edit.image.recipe=patch"), "expected one of default, .* did you mean patches"),
        (("edit=glass", "edit.name=a/b"), "edit.name: expected a letter and then letters"),
    ],
)
def test_a_mistake_is_one_sentence(words, message):
    with pytest.raises(ConfigError, match=message):
        edits_of(*words)


@pytest.mark.parametrize(
    ("name", "stages"),
    [
        ("glass", {"edit_image", "edit_metrics", "page"}),
        ("gold", {"edit_text", "edit_metrics", "page"}),
        ("lobe", {"edit_segment"}),
    ],
)
def test_each_method_has_its_stage(name, stages):
    config = compose(("dataset=engine", f"edit={name}"))
    assert {stage.name for stage in STAGES.values() if stage.applies(config)} == stages


def test_an_edit_reads_the_scene_of_its_base():
    config = compose(("dataset=engine", "edit=crimson"))
    files = STAGES["edit_text"].inputs(config)
    assert files["scene"].parts[-3:] == ("edits", "lobe", "scene.yaml")
    assert files["views.TF02"].parts[-3:] == ("TF02", "views", "transforms_train.json")
    assert STAGES["edit_text"].output(config).parts[-2:] == ("edits", "crimson")
    with pytest.raises(ConfigError, match="an edit is of a scene, with all basic TFs"):
        STAGES["edit_text"].inputs(compose(("dataset=engine", "edit=crimson", "tf=TF01")))
