"""Runs the eight jobs of `tests.track.jobs` and reads back what they recorded."""

import subprocess
import sys
from pathlib import Path

from mlflow import MlflowClient
from mlflow.artifacts import download_artifacts

from tests.track.jobs import N_JOBS, N_METRICS

ROOT = Path(__file__).parents[2]


def assert_eight_jobs_lose_nothing(folder, *uris):
    """On each of the stores: the child that forks the jobs loads MLflow once for all of them."""
    file = folder / "image.png"
    file.write_bytes(b"pixels")
    command = [sys.executable, "-m", "tests.track.jobs", str(file), *uris]
    child = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert (child.returncode, child.stdout, child.stderr) == (0, "", "")
    for uri in uris:
        _assert_all_is_there(uri)


def _assert_all_is_there(uri):
    client = MlflowClient(tracking_uri=uri)
    experiment = client.get_experiment_by_name("race")
    runs = client.search_runs([experiment.experiment_id])
    assert sorted(run.data.params["fit.seed"] for run in runs) == [str(index) for index in range(N_JOBS)]
    for run in runs:
        seed = int(run.data.params["fit.seed"])
        assert run.info.status == "FINISHED"
        assert run.info.run_name == f"job {seed}"
        assert run.data.tags["wildcards.dataset"] == f"volume {seed}"
        history = client.get_metric_history(run.info.run_id, "loss")
        assert sorted((metric.step, metric.value) for metric in history) == [
            (step, seed + step / 100) for step in range(N_METRICS)
        ]
        copy = download_artifacts(run_id=run.info.run_id, artifact_path="images/image.png", tracking_uri=uri)
        assert Path(copy).read_bytes() == b"pixels"
