"""What the words of a run select: data sets, recipes, sweeps, edits, and what is left out."""

import contextlib
from dataclasses import replace

import pytest

from texgs.config.project import ROOT
from texgs.core.errors import ConfigError, MissingDataError
from texgs.workflow.cases import LeftOut, cases_of
from texgs.workflow.locate import tf_names
from texgs.workflow.plan import make
from texgs.workflow.stage import fit_folder
from texgs.workflow.stage_table import STAGES
from texgs.workflow.sweep import as_sweep


def nothing(_config):
    return ()


def without(*names):
    """What lacks some data sets."""
    return lambda config: [f"{config.dataset.name} is not there"] if config.dataset.name in names else []


def configs(*words):
    """The configurations of no sweep."""
    return [case.config for case in cases_of(words, nothing).by_sweep[""]]


@pytest.fixture
def project(tmp_path, monkeypatch):
    """A project with two small experiments, and both together."""
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "conf" / "experiment"
    folder.mkdir(parents=True)
    texts = {
        "scenes": "datasets: [engine, jets, sphere]\nsweeps: {views: jets, resolution: sphere}\n",
        "pictures": "datasets: [engine, wood]\nfits: [quick, gaussians_quick]\nedits: [glass, stylesplat]\n",
        "both": "experiments: [scenes, pictures]\n"
        "on_missing: skip\nper_dataset: {wood: [dataset.image=99]}\n",
        "more": "experiments: [demo]\nviews: {width: 99}\n",
        "nested": "experiments: [both]\n",
        "misaimed": "experiments: [scenes, pictures]\nper_dataset: {woud: []}\n",
    }
    for name, text in texts.items():
        (folder / f"{name}.yaml").write_text(f"# @package _global_\n{text}")
    return folder


PICTURES, SCENES, BOTH = "experiment=pictures", "experiment=scenes", "experiment=both"
ALL = ["engine", "jets", "sphere"]


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        # A data set that is named wins over the list of an experiment.
        ((PICTURES,), {"": ["engine", "wood"]}),
        ((PICTURES, "dataset=engine"), {"": ["engine"]}),
        ((PICTURES, "dataset=orbital"), {"": ["orbital"]}),
        ((PICTURES, "datasets=[engine,jets]"), {"": ["engine", "jets"]}),
        # Sweeps of other data sets are not run where one is named, and all can be switched off.
        ((SCENES, "dataset=jets"), {"": ["jets"], "views": ["jets"]}),
        ((SCENES, "dataset=engine"), {"": ["engine"]}),
        (
            (SCENES, "dataset=engine", "sweeps.views=engine"),
            {"": ["engine"], "views": ["engine"], "resolution": ["sphere"]},
        ),
        *(((SCENES, off), {"": ALL}) for off in ("sweeps={}", "sweeps=null", "~sweeps", "sweep=none")),
        ((SCENES, "~sweeps.views"), {"": ALL, "resolution": ["sphere"]}),
        # Of a union those are run that have the data set that is named.
        ((BOTH, "dataset=jets"), {"": ["jets"], "views": ["jets"]}),
        ((BOTH, "dataset=wood"), {"": ["wood"]}),
    ],
)
def test_data_sets_of_a_run_and_of_its_sweeps(project, words, expected):
    by_sweep = cases_of(words, nothing).by_sweep.items()
    assert {
        sweep: sorted({each.config.dataset.name for each in some}) for sweep, some in by_sweep
    } == expected


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("dataset=engine", "dataset.wood.image=99"), r"dataset\.wood: expected one of the data sets of"),
        (("dataset=engine", "dataset.would.image=99"), r"dataset\.would"),  # there is no such key
        (
            ("dataset=engine", "+per_dataset.enginge=[]"),
            "per_dataset: expected names of data sets, got enginge",
        ),
        (("experiment=misaimed",), r"per_dataset: expected names of data sets, got woud, did you mean wood"),
        ((BOTH, "dataset=orbital"), "dataset: expected data sets of scenes, pictures, got orbital"),
        (("experiment=more",), "views: an experiment with `experiments` sets experiments, common_overrides"),
        (("experiment=nested",), "expected single experiments, got both, which has several"),
        (("datasets=[engine,engine]",), "datasets: expected different names, got engine twice"),
    ],
)
def test_a_mistake_is_one_sentence(project, words, message):
    with pytest.raises(ConfigError, match=message):
        cases_of(words, nothing)


def test_words_can_be_aimed_at_one_data_set():
    words = ("datasets=[engine,jets]", "dataset.jets.image=99", "dataset.jets.fit.seed=4", "fit=quick")
    by_name = {each.dataset.name: (each.views.width, each.fit.seed) for each in configs(*words)}
    assert by_name == {"engine": (512, 0), "jets": (99, 4)}
    (single,) = configs("dataset=jets", "dataset.jets.image=50")
    assert single.dataset.image == 50


def test_experiments_and_unions_can_aim_words(project):
    reduce = {each.dataset.name: each.fit.reduce for each in configs("experiment=paper_scenes_quick")}
    assert reduce.pop("vortex") == 2
    assert set(reduce.values()) == {1}
    for later, width in (((), 99), (("dataset.wood.image=77",), 77)):
        listed = configs(BOTH, "fit=quick", *later)
        assert {each.dataset.name for each in listed if each.views.width == width} == {"wood"}


def test_words_of_the_user_win_over_those_of_an_experiment_for_one_data_set(project):
    wood = {
        each.views.width
        for each in configs(BOTH, "fit=quick", "dataset.image=50")
        if "wood" in str(each.dataset.name)
    }
    assert wood == {50}
    reduce = {each.fit.reduce for each in configs("experiment=paper_scenes_quick", "fit.reduce=4")}
    assert reduce == {4}


def test_a_recipe_that_does_not_replace_the_list_of_an_experiment_is_noted(project):
    left_out = [each.what for each in cases_of((PICTURES, "fit=demo"), nothing).left_out]
    assert left_out == ["fit=demo"]
    assert not cases_of((PICTURES, "fit=quick"), nothing).left_out
    assert not cases_of((PICTURES, "fits=[demo]"), nothing).left_out


def test_seeds_repeat_the_sweep_that_an_experiment_has():
    by_sweep = cases_of(("experiment=resolution_quick", *as_sweep(("fit.seed=0,1",))), nothing).by_sweep
    assert {name: {case.config.fit.seed for case in some} for name, some in by_sweep.items()} == {
        "resolution_quick": {0, 1}
    }


def test_a_union_runs_each_of_its_experiments(project):
    listed = configs(BOTH, "fit=quick")
    assert {(each.dataset.name, fit_folder(each), each.edit.name) for each in listed} == {
        *((name, "quick", "none") for name in ("engine", "jets", "sphere", "wood")),
        *((name, "gaussians_quick", "none") for name in ("engine", "wood")),
        *((name, "quick", "glass") for name in ("engine", "wood")),
        *((name, "gaussians_quick", "stylesplat") for name in ("engine", "wood")),
    }


@pytest.mark.parametrize(
    ("words", "skips"),
    [
        ((SCENES,), False),
        ((SCENES, "on_missing=skip"), True),
        ((BOTH,), True),  # as its file says
        ((BOTH, "dataset=jets"), False),  # what is asked for by its name is not left out
        ((BOTH, "dataset=jets", "on_missing=skip"), True),
        ((BOTH, "on_missing=stop"), False),
    ],
)
def test_what_is_missing_is_left_out_and_told_where_that_is_asked_for(project, words, skips):
    cases = cases_of(words, without("jets"))
    assert ("jets" in {each.dataset.name for each in cases.configs}) is not skips
    assert ("views" in cases.by_sweep) is not skips
    told = {LeftOut("data set jets", "jets is not there")} if skips else set()
    assert set(cases.left_out) == told
    assert all({"views", "phase", "pse"} <= set(places) for places in cases.left_out.values())


def test_edits_that_lack_something_go_with_all_that_start_from_them():
    words = ("dataset=orbital", "fit=demo", "edits=[glass,gold,crimson]", "on_missing=skip")
    cases = cases_of(words, lambda config: ["no weights"] if config.edit.name == "lobe" else [])
    assert [case.config.edit.name for case in cases.by_sweep[""]] == ["none", "glass", "gold"]
    assert list(cases.by_sweep[""][0].config.edits) == ["glass", "gold"]  # what the gallery shows
    assert [each.what for each in cases.left_out] == ["edit lobe"]


def test_a_sweep_of_edits_without_any_has_no_fits_either():
    """Its table would be promised, and nothing would be in it."""
    words = ("dataset=orbital", "fit=demo", "sweep=lambda_s", "on_missing=skip")
    cases = cases_of(words, lambda config: ["no weights"] if config.edit.name == "style" else [])
    assert not cases.by_sweep.get("lambda_s")
    assert {entry.why for entry in cases.left_out} == {"no weights"}
    assert cases_of(words, nothing).by_sweep["lambda_s"]


@pytest.mark.workflow
def test_the_experiments_of_a_union_make_no_two_jobs_in_one_folder():
    """Each shipped union, with all data and weights there: the same folder is always the same job."""
    files = (ROOT / "conf" / "experiment").glob("*.yaml")
    unions = [path.stem for path in files if "\nexperiments:" in path.read_text()]
    assert {"paper", "paper_quick"} <= set(unions)
    for union in unions:
        of_folder = {}
        for config in cases_of((f"experiment={union}", "on_missing=stop"), nothing).configs:
            for stage, each in stages_of(config):
                with contextlib.suppress(MissingDataError):
                    job = stage.settings(each), stage.inputs(each)
                    assert of_folder.setdefault(stage.output(each), job) == job, stage.output(each)


@pytest.mark.workflow
def test_the_whole_paper_has_images_of_each_data_sets_size():
    by_sweep = cases_of(("experiment=paper", "on_missing=stop"), nothing).by_sweep
    listed = [each.config for sweep, some in by_sweep.items() if sweep != "resolution" for each in some]
    sizes = {(each.dataset.name, each.dataset.image, each.views.width, each.views.height) for each in listed}
    assert {image for _, image, _, _ in sizes} >= {512, 800}
    assert not [each for each in sizes if len({*each[1:]}) > 1]


@pytest.mark.parametrize("name", ["paper_image", "paper_text", "paper_frozen", "paper_meshes"])
def test_all_fields_of_a_comparison_of_the_paper_learn_from_the_same_views(name):
    listed = configs(f"experiment={name}")
    assert len({each.fit.name for each in listed}) > 1
    assert len({repr(each.views) for each in listed if each.dataset.name == listed[0].dataset.name}) == 1


def stages_of(config):
    """The stages of a configuration with those of its jobs, but for data sets that are not there."""
    for stage in STAGES.values():
        with contextlib.suppress(MissingDataError):
            for each in [replace(config, tf=name) for name in tf_names(config)] if stage.per_tf else [config]:
                if stage.applies(each):
                    yield stage, each


def test_edits_of_one_transfer_function_are_refused():
    words = ("dataset=sphere", "fit=quick", "tf=TF01", "edits=[glass]")
    with pytest.raises(ConfigError, match="tf: an edit is of a scene, with all basic TFs; leave out tf=TF01"):
        make(words)


def test_results_have_a_folder_of_their_own():
    with pytest.raises(ConfigError, match="results: expected a folder of its own"):
        make(("dataset=sphere", "fit=quick", "results=."))
