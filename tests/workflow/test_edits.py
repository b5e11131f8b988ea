"""The edits of an experiment: what they start from, their stages and what these read, and their mistakes."""

import pytest

from tests.refusals import refused
from texgs.config.case import Case
from texgs.config.compose import compose
from texgs.config.project import members
from texgs.core.errors import ArgumentError, ConfigError, MissingDataError
from texgs.scene.series_file import Series, write_series
from texgs.workflow.checks import check_edit, require_edit
from texgs.workflow.edits import edits_of, files_of_scene
from texgs.workflow.stage_table import STAGES


def edits(*words):
    return [case.config.edit for case in edits_of(Case(words))]


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
    assert [edit.name for edit in edits(*words)] == names


def test_words_hold_for_the_edit_and_its_base_and_parts_can_be_given():
    words = ("edit=glass", "edit.base=lobe", "edit.parts=[TF02/lobe]", "edit.name=part")
    lobe, part = edits(*words, "edit.image.iterations=7")
    assert (lobe.name, lobe.method, lobe.base, list(lobe.parts)) == ("lobe", "segment", None, [])
    assert (part.name, part.method, part.base, list(part.parts)) == ("part", "image", "lobe", ["TF02/lobe"])
    assert part.image.iterations == 7


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("edits=[glass, glass]",), "edits: expected different names, got glass twice"),
        (("edits=[glas]",), "edit: expected one of .*crimson, .*glass, "),
        (("edits=[none]",), "edit=none: expected a method, got none; write `method: NAME` into"),
        (("edit=glass", "edit.base=glass"), "edit.base: glass starts from itself"),
        (("edit=glass", "edit.base=lobes"), "edit.base: expected the file of a scene or one of .* mean lobe"),
        (("edit=glass", "edit.parts=[TF09]"), "edit.parts: expected some of TF01, .*, got TF09"),
        (("edit=lobe", "edit.segment.model=TF09"), "edit.segment.model: expected one of TF01, .*, got TF09"),
        (("edit=glass", "edit.image.lambda_s=1.5"), "edit.image.lambda_s: expected at most 1, got 1.5"),
        (("edit=glass", "edit.image.recipe=patch"), "expected one of default, .* did you mean patches"),
    ],
)
def test_a_mistake_in_edits_is_one_sentence(words, message):
    refused(lambda: edits(*words), message, ConfigError)


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
    of_tf = compose(("dataset=engine", "edit=crimson", "tf=TF01"))
    refused(lambda: STAGES["edit_text"].inputs(of_tf), "leave out tf=TF01", ConfigError)


def test_measures_of_a_look_read_the_volume_of_its_scene_if_it_has_one(tmp_path):
    """For the order of depth."""
    files = STAGES["edit_metrics"].inputs(compose(("dataset=engine", "edit=glass")))
    assert files["volume"].parts[-3:] == ("engine", "volume", "volume.nrrd")
    assert "volume" not in STAGES["edit_image"].inputs(compose(("dataset=engine", "edit=glass")))
    (views := tmp_path / "vortex" / "TF01" / "transforms_train.json").parent.mkdir(parents=True)
    views.touch()
    of_views = compose(("dataset=vortex", "edit=glass", f"data_folder={tmp_path}"))
    assert "volume" not in STAGES["edit_metrics"].inputs(of_views)


FITS = {
    "arf": "plenoxels_quick",
    **dict.fromkeys(("igs2gs", "dge"), "gaussians_quick"),
    "stylerf": "stylerf_quick",
}


@pytest.mark.parametrize("edit", ["none", "style", "glass", "text", "gold", "crimson", "lobe"])
def test_edits_of_the_project_have_no_mistake(edit):
    check_edit(compose((f"edit={edit}",)))


@pytest.mark.parametrize(
    ("edit", "word", "message"),
    [
        ("style", "edit.image.style=nowhere.png", "no such file as 'nowhere.png'; .* one of strokes, glass,"),
        ("glass", "edit.image.region=[[2, 0]]", "edit.image.region: expected two shares from 0 to below 1"),
        ("text", "edit.text.instruction=", "instruction: expected what to do in words"),
        ("gold", "edit.text.instruction=fur", "which needs guidance=instruct_pix2pix"),
        ("lobe", "edit.segment.name=", "edit.segment.name: expected a name without / . ="),
        ("lobe", "edit.segment.points=[]", "edit.segment.points: expected one at least"),
        ("lobe", "edit.segment.view=[3]", r"edit.segment.view: expected azimuth and polar angle, got \[3.0"),
        ("lobe", "edit.segment.views=40", "views: expected 12, 42, 92"),
        ("lobe", "edit.looks=true", "expected a method that follows a picture or an instruction, got seg"),
        ("arf", "fit=quick", "edit arf: expected a fit of voxels, got one of surfels"),
        ("arf", "edit.arf.nnfm=0", "edit.arf.nnfm, edit.arf.patches: expected a weight above 0 for one of"),
        ("stylerf", "edit.stylerf.styles=[dots,none.png]", "edit.stylerf.styles: no such file as"),
        ("stylerf", "edit.stylerf.styles=[dots,glass]", "expected one for each of 1 palette colours of fit="),
        ("dge_quick", "edit.dge.instruction=make it odd", "instruction: expected"),
        ("igs2gs_quick", "edit.igs2gs.l1=0|edit.igs2gs.dssim=0", "l1, dssim, lpips: expected a weight above"),
    ],
)
def test_a_mistake_in_an_edit_is_one_sentence(edit, word, message):
    fit = FITS.get(edit.removesuffix("_quick"), "demo")
    config = compose(("dataset=sphere", f"fit={fit}", f"edit={edit}", *word.split("|")))
    refused(lambda: check_edit(config), message, (ArgumentError, ConfigError))


def require(words):
    require_edit(STAGES[f"edit_{compose(words).edit.method}"], Case(words))


def test_what_an_edit_by_hand_starts_from_is_told_at_once(tmp_path):
    words = ("dataset=engine", "edit=crimson", f"results={tmp_path}")
    other = (*words[::2], "edit=glass", "edit.base=lobe", "edit.parts=[TF01]")
    for each in (words, other):
        refused(lambda each=each: require(each), r"edit_segment .* edit=lobe first", MissingDataError)
    refused(lambda: require((*words, "edit.base=none-such")), r"edit\.base: ", ConfigError)
    refused(lambda: require((*words[::2], "edit=glass", "edit.parts=[x]")), r"edit\.parts: ", ConfigError)
    require(("dataset=engine", "edit=glass"))


def test_an_edit_of_a_scene_of_a_series_comes_from_all_of_its_steps(tmp_path):
    series = Series(tmp_path / "series.json", ["a", "b"], ["ball"])
    write_series(series)
    for step in (0, 1):
        series.model("ball", step).touch()
    (tmp_path / "ball.safetensors").touch()
    (scene := tmp_path / "scene.yaml").write_text(
        "models: {ball: {file: ball.safetensors}}\nseries: series.json"
    )
    files = {path.name for path in files_of_scene(scene).values()}
    assert files == {"ball.safetensors", "series.json", *(series.model("ball", step).name for step in (0, 1))}


@pytest.mark.parametrize(
    ("light", "names"),
    [
        ("headlight", {"ball.safetensors"}),
        ("{azimuth: 3, polar: 4}", {"ball.safetensors"}),
        ("{azimuth: 3, polar: 4, shadows: 0.5}", {"ball.safetensors", "volume.nrrd"}),
    ],
)
def test_an_edit_of_a_scene_with_shadows_comes_from_its_volume_too(tmp_path, light, names):
    for name in ("ball.safetensors", "volume.nrrd"):
        (tmp_path / name).touch()
    text = f"models: {{ball: {{file: ball.safetensors}}}}\nlight: {light}\nvolume: {{file: volume.nrrd}}\n"
    (scene := tmp_path / "scene.yaml").write_text(text)
    assert {path.name for path in files_of_scene(scene).values()} == names
