"""The workflow with MLflow on: a run per job, and what its tags say."""

import json

from mlflow import MlflowClient

from tests.workflow.project import Project


def test_every_job_has_a_finished_run(tmp_path):
    project = Project(tmp_path)
    done = project.snakemake(config=("tracking=mlflow",), overrides="~dataset.basic_tfs.TF02")
    assert done.returncode == 0, done.stdout + done.stderr
    client = MlflowClient(f"sqlite:///{project.work}/results/mlflow.db")
    (experiment,) = (each for each in client.search_experiments() if each.name == "texgs")
    runs = client.search_runs([experiment.experiment_id])
    assert {run.info.status for run in runs} == {"FINISHED"}
    tags = ("snakemake.rule", "wildcards.tf", "config.sha", "code.sha")
    recorded = {run.info.run_id: tuple(run.data.tags.get(tag) for tag in tags) for run in runs}
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
