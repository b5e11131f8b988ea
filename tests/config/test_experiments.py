"""What the words of a run select: data sets, recipes, sweeps, edits, and what is left out."""

import contextlib
import itertools
from dataclasses import replace

import pytest

from texgs.config.project import ROOT
from texgs.core.errors import ConfigError, MissingDataError
from texgs.workflow.experiments import LeftOut, selected
from texgs.workflow.locate import tf_names
from texgs.workflow.stage import fit_folder
from texgs.workflow.stage_table import STAGES


def nothing(_config):
    return ()


def data_sets(*words, lacking=nothing):
    """Names of the data sets of each sweep, "" for none."""
    selection = selected(words, lacking)
    return {
        sweep: sorted({each.dataset.name for each in configs})
        for sweep, configs in selection.by_sweep.items()
    }


def without(*names):
    """What lacks some data sets."""
    return lambda config: [f"{config.dataset.name} is not there"] if config.dataset.name in names else []


@pytest.fixture
def project(tmp_path, monkeypatch):
    """A project with two small experiments, and both together."""
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "conf" / "experiment"
    folder.mkdir(parents=True)
    texts = {
        "scenes": "datasets: [engine, jets, sphere]\nsweeps: {views: jets, resolution: sphere}\n",
        "pictures": "datasets: [engine, wood]\nfits: [quick, gaussians_quick]\nedits: [glass, stylesplat]\n",
        "both": "experiments: [scenes, pictures]\nmissing: skip\naimed: {wood: [dataset.image=99]}\n",
    }
    for name, text in texts.items():
        (folder / f"{name}.yaml").write_text(f"# @package _global_\n{text}")
    return folder


def test_a_data_set_that_is_named_wins_over_the_list_of_an_experiment(project):
    assert data_sets("experiment=pictures") == {"": ["engine", "wood"]}
    assert data_sets("experiment=pictures", "dataset=engine") == {"": ["engine"]}
    assert data_sets("experiment=pictures", "dataset=orbital") == {"": ["orbital"]}
    assert data_sets("experiment=pictures", "datasets=[engine,jets]") == {"": ["engine", "jets"]}


def test_sweeps_of_other_data_sets_are_not_run_where_one_is_named(project):
    assert data_sets("experiment=scenes", "dataset=jets") == {"": ["jets"], "views": ["jets"]}
    assert data_sets("experiment=scenes", "dataset=engine") == {"": ["engine"]}
    assert data_sets("experiment=scenes", "dataset=engine", "sweeps.views=engine") == {
        "": ["engine"],
        "views": ["engine"],
        "resolution": ["sphere"],
    }


@pytest.mark.parametrize("off", ["sweeps={}", "sweeps=null", "~sweeps", "sweep=none"])
def test_sweeps_can_be_switched_off(off, project):
    assert list(data_sets("experiment=scenes", off)) == [""]


def test_one_sweep_can_be_switched_off(project):
    assert list(data_sets("experiment=scenes", "~sweeps.views")) == ["", "resolution"]


def test_words_can_be_aimed_at_one_data_set():
    words = ("datasets=[engine,jets]", "dataset.jets.image=99", "dataset.jets.fit.seed=4", "fit=quick")
    selection = selected(words, nothing)
    by_name = {config.dataset.name: config for config in selection.by_sweep[""]}
    assert (by_name["engine"].views.width, by_name["engine"].fit.seed) == (512, 0)
    assert (by_name["jets"].views.width, by_name["jets"].fit.seed) == (99, 4)
    (single,) = selected(("dataset=jets", "dataset.jets.image=50"), nothing).by_sweep[""]
    assert single.dataset.image == 50


def test_words_aimed_at_no_data_set_of_the_run_are_told():
    with pytest.raises(ConfigError, match=r"dataset\.wood: expected one of the data sets of this run"):
        selected(("dataset=engine", "dataset.wood.image=99"), nothing)
    with pytest.raises(ConfigError, match=r"dataset\.would"):  # by Hydra: there is no such key
        selected(("dataset=engine", "dataset.would.image=99"), nothing)


def test_an_experiment_can_aim_words():
    selection = selected(("experiment=paper_scenes_quick",), nothing)
    reduce = {config.dataset.name: config.fit.reduce for config in selection.by_sweep[""]}
    assert reduce.pop("vortex") == 2
    assert set(reduce.values()) == {1}
    with pytest.raises(ConfigError, match="aimed: expected names of data sets, got enginge"):
        selected(("dataset=engine", "+aimed.enginge=[]"), nothing)


def test_a_union_runs_each_of_its_experiments(project):
    runs = {
        (config.dataset.name, fit_folder(config), config.edit.name)
        for config in selected(("experiment=both", "fit=quick"), nothing).by_sweep[""]
    }
    assert runs == {
        *((name, "quick", "none") for name in ("engine", "jets", "sphere", "wood")),
        *((name, "gaussians_quick", "none") for name in ("engine", "wood")),
        *((name, "quick", "glass") for name in ("engine", "wood")),
        *((name, "gaussians_quick", "stylesplat") for name in ("engine", "wood")),
    }


def test_a_union_can_aim_words(project):
    configs = selected(("experiment=both", "fit=quick"), nothing).by_sweep[""]
    assert {config.dataset.name for config in configs if config.views.width == 99} == {"wood"}
    later = selected(("experiment=both", "fit=quick", "dataset.wood.image=77"), nothing).by_sweep[""]
    assert {config.dataset.name for config in later if config.views.width == 77} == {"wood"}
    (project / "both.yaml").write_text(
        "# @package _global_\nexperiments: [scenes, pictures]\naimed: {woud: []}\n"
    )
    with pytest.raises(ConfigError, match=r"aimed: expected names of data sets, got woud, did you mean wood"):
        selected(("experiment=both", "fit=quick", "results=elsewhere"), nothing)


def test_of_a_union_the_experiments_with_the_data_set_that_is_named_are_run(project):
    assert data_sets("experiment=both", "dataset=jets") == {"": ["jets"], "views": ["jets"]}
    assert data_sets("experiment=both", "dataset=wood") == {"": ["wood"]}
    with pytest.raises(ConfigError, match="dataset: expected data sets of scenes, pictures, got orbital"):
        selected(("experiment=both", "dataset=orbital"), nothing)


def test_a_union_sets_nothing_else_and_has_no_union(project):
    (project / "more.yaml").write_text("# @package _global_\nexperiments: [demo]\nviews: {width: 99}\n")
    with pytest.raises(ConfigError, match="views: an experiment with `experiments` sets experiments, each"):
        selected(("experiment=more",), nothing)
    (project / "nested.yaml").write_text("# @package _global_\nexperiments: [both]\n")
    with pytest.raises(ConfigError, match="expected single experiments, got both, which has several"):
        selected(("experiment=nested",), nothing)


def test_what_is_missing_is_left_out_and_told(project):
    selection = selected(("experiment=scenes", "missing=skip"), without("engine", "jets"))
    assert set(selection.by_sweep) == {"", "resolution"}
    assert {config.dataset.name for config in selection.by_sweep[""]} == {"sphere"}
    places = selection.left_out[LeftOut("data set engine", "engine is not there")]
    assert {"views", "phase", "pse"} <= set(places)
    assert len(selection.left_out) == 2


@pytest.mark.parametrize(
    ("words", "skips"),
    [
        (("experiment=scenes",), False),
        (("experiment=both",), True),  # as its file says
        (("experiment=both", "dataset=jets"), False),  # what is asked for by its name is not left out
        (("experiment=both", "dataset=jets", "missing=skip"), True),
        (("experiment=both", "missing=stop"), False),
    ],
)
def test_what_is_missing_is_left_out_where_that_is_asked_for(words, skips, project):
    selection = selected(words, without("jets"))
    assert bool(selection.left_out) is skips
    assert ("jets" in {config.dataset.name for config in selection.by_sweep[""]}) is not skips


def test_edits_that_lack_something_go_with_all_that_start_from_them():
    def lacking(config):
        return ["no weights"] if config.edit.name == "lobe" else []

    words = ("dataset=orbital", "fit=demo", "edits=[glass,gold,crimson]", "missing=skip")
    selection = selected(words, lacking)
    assert [config.edit.name for config in selection.by_sweep[""]] == ["none", "glass", "gold"]
    assert list(selection.by_sweep[""][0].edits) == ["glass", "gold"]  # what the gallery shows
    assert [each.what for each in selection.left_out] == ["edit lobe"]


def test_a_sweep_of_edits_without_any_has_no_fits_either():
    """Its table would be promised, and nothing would be in it."""
    words = ("dataset=orbital", "fit=demo", "sweep=lambda_s", "missing=skip")
    selection = selected(words, lambda config: ["no weights"] if config.edit.name == "style" else [])
    assert not selection.by_sweep.get("lambda_s")
    assert {entry.why for entry in selection.left_out} == {"no weights"}
    assert selected(words, nothing).by_sweep["lambda_s"]


def test_the_experiments_of_a_union_make_no_two_jobs_in_one_folder():
    """Each shipped union, with all data and weights there: the same folder is always the same job."""
    files = (ROOT / "conf" / "experiment").glob("*.yaml")
    unions = [path.stem for path in files if "\nexperiments:" in path.read_text()]
    assert {"paper", "paper_quick"} <= set(unions)
    for union in unions:
        of_folder = {}
        selection = selected((f"experiment={union}", "missing=stop"), nothing)
        for config in itertools.chain(*selection.by_sweep.values()):
            for stage, each in jobs_with_all_data(config):
                job = stage.settings(each), stage.inputs(each)
                assert of_folder.setdefault(stage.output(each), job) == job, stage.output(each)


def jobs_with_all_data(config):
    """The jobs of a configuration, but for those of files that are not there."""
    for stage in STAGES.values():
        with contextlib.suppress(MissingDataError):
            for each in [replace(config, tf=name) for name in tf_names(config)] if stage.per_tf else [config]:
                if stage.applies(each):
                    stage.inputs(each)
                    yield stage, each
