"""The workflow with MLflow on: a run per job, and what its tags say."""

import hashlib
import json

import pytest
from mlflow import MlflowClient

from tests.workflow.project import Project

pytestmark = pytest.mark.workflow


def test_every_job_has_a_finished_run(tmp_path):
    project = Project(tmp_path)
    done = project.snakemake(config=("tracking=mlflow",), overrides="~dataset.basic_tfs.TF02")
    assert done.returncode == 0, done.stdout + done.stderr
    client = MlflowClient(f"sqlite:///{project.work}/results/mlflow.db")
    (experiment,) = (each for each in client.search_experiments() if each.name == "texgs")
    runs = client.search_runs([experiment.experiment_id])
    assert {run.info.status for run in runs} == {"FINISHED"}
    tags = ("stage", "tf", "config.sha", "code.sha")
    (workflow,) = (run for run in runs if run.data.tags["stage"] == "workflow")
    children = [run for run in runs if run is not workflow]
    assert {run.data.tags["mlflow.parentRunId"] for run in children} == {workflow.info.run_id}
    recorded = {run.info.run_id: tuple(run.data.tags.get(tag) for tag in tags) for run in children}
    jobs = {}
    for path in (project.work / "results" / "turbulence").rglob("metrics.json"):
        metrics = json.loads(path.read_text())
        jobs[metrics["run"]] = tuple(metrics.get(key) for key in ("stage", "tf", "config_sha", "code_sha"))
    assert recorded == jobs
    assert sorted((rule, tf or "") for rule, tf, _, _ in jobs.values()) == [
        ("sheet", "TF01"),
        ("transfer", ""),
        ("views", "TF01"),
        ("volume", ""),
    ]
    settings = {path.stem.partition("-")[2] for path in (project.work / "results" / ".conf").iterdir()}
    assert {config_sha for _, _, config_sha, _ in jobs.values()} <= settings


def test_the_best_psnr_by_view_count_is_a_query(tmp_path):
    project = Project(tmp_path)
    words = "fit.surfels.iterations=4 fit.shading.iterations=4 fit.shading.densify.stop=2"
    done = project.snakemake(
        targets=("report",),
        config=("tracking=mlflow", "dataset=sphere", "fit=demo"),
        overrides=f"fit.seeds.count=300 {words} views.train.frequency=1,2 fit.seed=0,3",
    )
    assert done.returncode == 0, done.stdout + done.stderr
    client = MlflowClient(f"sqlite:///{project.work}/results/mlflow.db")
    (experiment,) = (each.experiment_id for each in client.search_experiments() if each.name == "texgs")

    fits = client.search_runs(
        [experiment],
        "tags.stage = 'texture' and tags.sweep = 'frequency'",
        order_by=["metrics.psnr DESC"],
    )
    assert len(fits) == 4
    by_count = {run.data.params["views.train.frequency"]: run.data.metrics["psnr"] for run in fits[::-1]}
    assert set(by_count) == {"1", "2"}
    assert by_count["2"] == fits[0].data.metrics["psnr"] > by_count["1"], "42 views are better than 12"
    assert {run.data.params["fit.seed"] for run in fits} == {"0", "3"}
    assert {run.info.run_name for run in fits} == {
        f"sphere TF01 demo-{variant} texture" for variant in ("1", "1-s3", "2", "2-s3")
    }

    (sweep,) = client.search_runs([experiment], "tags.stage = 'sweep'")
    (workflow,) = client.search_runs([experiment], "tags.stage = 'workflow'")
    assert (sweep.info.status, workflow.info.status) == ("FINISHED", "FINISHED")
    assert sweep.data.tags["mlflow.parentRunId"] == workflow.info.run_id
    assert {run.data.tags["mlflow.parentRunId"] for run in fits} == {sweep.info.run_id}
    assert sweep.data.params == {"keys": "fit.seed, views.train.frequency"}
    assert [each.path for each in client.list_artifacts(workflow.info.run_id)] == ["report.html"]

    (surfels, *_) = client.search_runs([experiment], "tags.stage = 'surfels'")
    curve = client.get_metric_history(surfels.info.run_id, "loss")
    assert curve, "a loss over iterations"
    assert curve[-1].step == 4
    model = project.work / fits[0].data.tags["file"]
    assert hashlib.sha256(model.read_bytes()).hexdigest() == fits[0].data.tags["file.sha256"]
