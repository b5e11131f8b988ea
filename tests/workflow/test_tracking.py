"""The workflow with MLflow on: a run per job, and what its tags say."""

import hashlib
import json

import pytest
from mlflow import MlflowClient

from tests.workflow.project import Project

pytestmark = pytest.mark.workflow

FIT = "fit.surfels.iterations=4 fit.shading.iterations=4 fit.shading.densify.stop=2 fit.seeds.count=300"


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """The tracked run of a sweep over views and seeds."""
    project = Project(tmp_path_factory.mktemp("tracked"))
    done = project.snakemake(
        targets=("report",),
        config=("tracking=mlflow", "dataset=sphere", "fit=demo"),
        overrides=f"{FIT} views.train.frequency=1,2 fit.seed=0,3",
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return project


@pytest.fixture
def client(project):
    return MlflowClient(f"sqlite:///{project.work}/results/mlflow.db")


@pytest.fixture
def search(client):
    """Find the runs of a stage of the workflow, the best first."""
    (experiment,) = (each.experiment_id for each in client.search_experiments() if each.name == "texgs")

    def search(words="", order=("metrics.psnr DESC",)):
        return client.search_runs([experiment], words, order_by=order)

    return search


def test_every_job_has_a_finished_run(project, search):
    runs = search()
    assert {run.info.status for run in runs} == {"FINISHED"}
    tags = ("stage", "tf", "config.sha", "code.sha")
    children = [run for run in runs if run.data.tags["stage"] not in ("workflow", "sweep")]
    recorded = {run.info.run_id: tuple(run.data.tags.get(tag) for tag in tags) for run in children}
    jobs = {}
    for path in (project.work / "results" / "sphere").rglob("metrics.json"):
        metrics = json.loads(path.read_text())
        jobs[metrics["run"]] = tuple(metrics.get(key) for key in ("stage", "tf", "config_sha", "code_sha"))
    assert recorded == jobs
    assert {"volume", "views", "surfels", "shading", "texture"} <= {stage for stage, *_ in jobs.values()}
    settings = {path.stem.partition("-")[2] for path in (project.work / "results" / ".conf").iterdir()}
    assert {config_sha for _, _, config_sha, _ in jobs.values()} <= settings


def test_the_best_psnr_by_view_count_is_a_query(search):
    fits = search("tags.stage = 'texture' and tags.sweep = 'train_frequency'")
    assert len(fits) == 4
    by_count = {run.data.params["views.train.frequency"]: run.data.metrics["psnr"] for run in fits[::-1]}
    assert set(by_count) == {"1", "2"}
    assert max(by_count.values()) == fits[0].data.metrics["psnr"]
    assert {run.data.params["fit.seed"] for run in fits} == {"0", "3"}
    assert {run.info.run_name for run in fits} == {
        f"sphere TF01 demo-{variant} texture" for variant in ("1", "1-s3", "2", "2-s3")
    }


def test_runs_are_inside_of_those_of_sweep_and_workflow_and_hold_curves_and_files(project, client, search):
    (sweep,), (workflow,) = search("tags.stage = 'sweep'"), search("tags.stage = 'workflow'")
    fits = search("tags.stage = 'texture'")
    assert sweep.data.tags["mlflow.parentRunId"] == workflow.info.run_id
    assert {run.data.tags["mlflow.parentRunId"] for run in fits} == {sweep.info.run_id}
    assert sweep.data.params == {"keys": "fit.seed, views.train.frequency"}
    assert [each.path for each in client.list_artifacts(workflow.info.run_id)] == ["report.html"]
    curve = client.get_metric_history(search("tags.stage = 'surfels'")[0].info.run_id, "loss")
    assert curve, "a loss over iterations"
    assert curve[-1].step == 4
    model = project.work / fits[0].data.tags["file"]
    assert hashlib.sha256(model.read_bytes()).hexdigest() == fits[0].data.tags["file.sha256"]
