"""Eight jobs that start at once, on one store after another: python -m tests.track.eight FILE URI..."""

import multiprocessing
import subprocess
import sys
from pathlib import Path

# Here, so that the children start at once and do not load them again.
import mlflow.artifacts
import mlflow.store.tracking.sqlalchemy_store
from mlflow import MlflowClient

from texgs.workflow.runs import run

N_JOBS, N_METRICS = 8, 20


def job(index, barrier, uri, file):
    barrier.wait()
    job = {"name": f"job {index}", "tags": {"dataset": f"volume {index}"}, "params": {"fit.seed": str(index)}}
    with run(uri, experiment="race", **job) as record:
        for step in range(N_METRICS):
            record.log({"loss": index + step / 100}, step)
        record.artifact(file, "images")
    sys.exit(record.trouble)


def failures(uri, file):
    """How many of the jobs on a store fail."""
    context = multiprocessing.get_context("fork")
    barrier = context.Barrier(N_JOBS)
    jobs = [context.Process(target=job, args=(index, barrier, uri, file)) for index in range(N_JOBS)]
    for process in jobs:
        process.start()
    for process in jobs:
        process.join()
    return sum(process.exitcode != 0 for process in jobs)


def assert_eight_jobs_lose_nothing(folder, *uris):
    """On each of the stores: the child that forks the jobs loads MLflow once for all of them."""
    file = folder / "image.png"
    file.write_bytes(b"pixels")
    command = [sys.executable, "-m", "tests.track.eight", str(file), *uris]
    root = Path(__file__).parents[2]
    child = subprocess.run(command, cwd=root, capture_output=True, text=True, check=False)
    assert (child.returncode, child.stdout, child.stderr) == (0, "", "")
    for uri in uris:
        client = MlflowClient(tracking_uri=uri)
        runs = client.search_runs([client.get_experiment_by_name("race").experiment_id])
        seeds = sorted(run.data.params["fit.seed"] for run in runs)
        assert seeds == [str(index) for index in range(N_JOBS)], seeds
        for each in runs:
            seed = int(each.data.params["fit.seed"])
            assert (each.info.status, each.info.run_name) == ("FINISHED", f"job {seed}")
            assert each.data.tags["dataset"] == f"volume {seed}"
            history = client.get_metric_history(each.info.run_id, "loss")
            points = sorted((metric.step, metric.value) for metric in history)
            assert points == [(step, seed + step / 100) for step in range(N_METRICS)]
            where = {"run_id": each.info.run_id, "tracking_uri": uri}
            copy = mlflow.artifacts.download_artifacts(artifact_path="images/image.png", **where)
            assert Path(copy).read_bytes() == b"pixels"


if __name__ == "__main__":
    sys.exit(sum(failures(uri, sys.argv[1]) for uri in sys.argv[2:]))
