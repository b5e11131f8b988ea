"""Jobs of sweeps: which ones there are, what they share, and what tells them apart."""

import json
from collections import Counter
from pathlib import Path
from types import SimpleNamespace

import pytest

from texgs.core.errors import ConfigError
from texgs.workflow import plan
from texgs.workflow.graph import Graph
from texgs.workflow.notes import note_results
from texgs.workflow.plan import make, words_of
from texgs.workflow.stage_table import RULES
from texgs.workflow.tracked import WHOLE, owner

FITS = {"dataset": "sphere", "fit": "demo", "tracking": "none"}


@pytest.fixture
def planned(tmp_path, monkeypatch):
    """Makes a plan in a folder of its own."""
    monkeypatch.chdir(tmp_path)
    return lambda overrides, **words: make(words_of({**FITS, **words, "overrides": overrides}))[0]


def stages(plan):
    return Counter(job["stage"] for job in plan.jobs.values())


def test_a_sweep_of_edits_has_the_jobs_of_one_fit(planned):
    single = stages(planned("edit.text.size=64", edit="gold"))
    swept = stages(planned("edit.text.size=64,128,256 edit.seed=0,1", edit="gold"))
    assert single["edit_text"] == single["edit_metrics"] == 1
    assert swept == Counter({**single, "edit_text": 6, "edit_metrics": 6, "page": 0}), "a sweep has no pages"


def test_variants_with_the_same_fit_share_it(planned):
    swept = stages(planned("edit.text.size=64,128 fit.low_pass=2,6", edit="gold"))
    assert (swept["texture"], swept["edit_text"]) == (2, 4)


def test_jobs_know_the_values_that_are_theirs_alone(planned):
    plan = planned("views.train.frequency=1,2 fit.seed=0,1")
    told = {folder.removeprefix("results/sphere/"): job["swept"] for folder, job in plan.jobs.items()}
    frequency = "views.train.frequency"
    assert told["volume"] == {}
    assert told["TF01/views-1"] == {frequency: "1"}
    assert told["TF01/demo-2-s1/texture"] == {frequency: "2", "fit.seed": "1"}


def test_jobs_of_one_sweep_are_in_its_run_and_others_in_that_of_all(planned):
    plan = planned("+sweeps.views=sphere")
    assert owner(plan, "results/sphere/TF01/demo-42/texture") == "views"
    assert owner(plan, "results/sphere/TF01/demo/texture") == WHOLE
    assert owner(plan, "results/sphere/volume") == WHOLE, "both have it"


def test_a_run_of_a_sweep_makes_what_it_shows_and_what_that_needs():
    """All else that it plans stays as an earlier run left it, and in tables and report."""

    def job(place, *inputs):
        return SimpleNamespace(
            stage=SimpleNamespace(rule=RULES[place]), inputs=dict(enumerate(map(Path, inputs)))
        )

    jobs = {
        "r/views": job("views", "data/volume.nrrd"),
        "r/model": job("phase", "r/views/transforms_train.json"),
        "r/compose": job("compose", "r/model/model.safetensors"),
        "r/edit": job("edit", "r/compose/scene.yaml"),
        "r/timing": job("timing", "r/compose/scene.yaml"),
        "r/other": job("timing"),
    }
    swept = ["r/views", "r/model", "r/compose", "r/edit", "r/timing"]
    assert set(Graph(jobs, {"lambda_s": swept}).run) == {"r/views", "r/model", "r/compose", "r/edit"}
    assert set(Graph(jobs, {"": ["r/other"], "s": ["r/model"]}).run) == {"r/other", "r/views", "r/model"}


def test_every_gpu_that_some_configuration_needs_is_asked_for(planned):
    assert planned("").gpu == []
    assert planned("datasets=[sphere,orbital] dataset.orbital.device=cuda").gpu == ["fit", "views"]


def test_two_variants_of_one_folder_are_refused(planned):
    given = {"a": ["views.name=views-b", "views.width=16"], "b": ["views.width=32"]}
    words = " ".join(f'"+sweep.variants.{name}={listed}"' for name, listed in given.items())
    with pytest.raises(ConfigError, match=r"two jobs go there, which differ in .*; give both the same"):
        planned(f"sweep.name=x {words}")


def test_seeds_alone_repeat_the_experiment_and_its_gallery_shows_the_first(planned):
    grid = "[{name: fits, rows: [{title: front}], columns: [{}]}]"
    plan = planned(f'fit.seed=3,4 "gallery.grids={grid}"')
    assert list(plan.sweeps) == ["seeds"]
    (gallery,) = (job for job in plan.jobs.values() if job["stage"] == "gallery")
    assert {path.split("/")[-3] for path in gallery["inputs"].values()} == {"demo-seeds-s3"}


def test_a_gallery_of_a_sweep_of_edits_shows_the_edits_of_its_variants(planned):
    columns = "[{title: small, variant: '64'}, {title: large, variant: '128'}]"
    grid = f"{{name: sizes, rows: [{{edit: gold}}], columns: {columns}}}"
    words = "edit.text.size=64,128 edit.seed=5,6 edits=[gold]"
    plan = planned(f'{words} "gallery.grids=[{grid}]"')
    (gallery,) = (job for job in plan.jobs.values() if job["stage"] == "gallery")
    assert {path.split("/")[-2] for path in gallery["inputs"].values()} == {"gold-64-s5", "gold-128-s5"}


@pytest.mark.parametrize("order", [1, -1])
def test_a_damaged_result_is_noted_where_a_whole_one_has_the_same_settings(tmp_path, order):
    """As the views of a variant that has their default number."""
    file, jobs = tmp_path / "views.yaml", []
    file.write_text("width: 400\n")
    for name, is_whole in (("views", False), ("views-92", True)):
        (tmp_path / name).mkdir()
        (tmp_path / name / "metrics.json").touch()
        jobs.append(SimpleNamespace(output=tmp_path / name, is_done=lambda is_whole=is_whole: is_whole))
    note_results(jobs[::order], [str(file)] * 2)
    settings, note = file.read_text().splitlines()
    assert settings == "width: 400"
    assert note.endswith(f" {tmp_path / 'views'}: not whole, or of another job")
    jobs[0].is_done = lambda: True
    note_results(jobs[::order], [str(file)] * 2)
    assert file.read_text() == "width: 400\n"


def test_results_may_be_written_with_a_slash_at_the_end(planned):
    plan = planned("results=./out/ edits=[gold]")
    assert plan.results == "out"
    assert all(folder.startswith("out/") for folder in plan.jobs)
    assert all(job["settings"].startswith("out/.conf/") for job in plan.jobs.values())


@pytest.mark.parametrize("value", [None, [], "x", {}, {"jobs": 3}])
def test_a_damaged_plan_is_made_again_by_the_job_that_reads_it(tmp_path, monkeypatch, value):
    monkeypatch.chdir(tmp_path)
    words = words_of(FITS)
    expected, _ = plan.planned(words, is_job=False)
    (file,) = (tmp_path / ".snakemake" / "texgs").glob("plan-*.json")
    file.write_text(json.dumps({**json.loads(file.read_text()), "value": value}))
    assert plan.planned(words, is_job=True)[0] == expected
