import logging
import math
import os
import subprocess
import sys
from pathlib import Path

import pytest

from texgs.core.errors import ArgumentError
from texgs.workflow.tracking import TrackingError, record, run

ROOT = Path(__file__).parents[2]
JOB = {"experiment": "texgs", "name": "fit", "tags": {"git.sha": "0f3c"}, "params": {"fit": {"steps": 7}}}


@pytest.fixture
def warnings(caplog):
    """Lines of the logger of texgs."""
    caplog.set_level(logging.WARNING, logger="texgs")
    return lambda: [entry.getMessage() for entry in caplog.records if entry.name == "texgs"]


@pytest.fixture
def lost_store(monkeypatch):
    """Makes the store of a run fail until it is called again."""

    def switch(job, is_lost=True):
        def refuse(*_, **__):
            raise ConnectionError("the server hung up\nat port 5000")

        for name in ("log_batch", "log_artifact", "set_tag", "set_terminated"):
            if is_lost:
                monkeypatch.setattr(job._client, name, refuse)
            else:
                monkeypatch.delattr(job._client, name)

    return switch


def python(code, *arguments):
    """Output of a child process."""
    command = [sys.executable, "-c", code, *arguments]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)


def test_finished_run_holds_everything(uri, client, tmp_path):
    (tmp_path / "tables").mkdir()
    (tmp_path / "tables" / "a.csv").write_text("1")
    with run(uri, **JOB) as job:
        job.log({"psnr": 30, "ssim": 0.9})
        for step in range(3):
            job.log({"loss": 1 / (step + 1)}, step)
        job.log({"worst": math.nan, "most": math.inf, "clip@512": 0.3})
        job.artifact(tmp_path / "tables")
    stored = client.get_run(job.id)
    assert stored.info.status == "FINISHED"
    assert stored.info.run_name == "fit"
    assert client.get_experiment(stored.info.experiment_id).name == "texgs"
    assert stored.data.tags["git.sha"] == "0f3c"
    assert stored.data.params == {"fit.steps": "7"}
    assert stored.data.metrics["psnr"] == 30
    assert stored.data.metrics["clip_512"] == 0.3
    assert math.isnan(stored.data.metrics["worst"])
    assert [(m.step, m.value) for m in client.get_metric_history(job.id, "loss")] == [
        (0, 1),
        (1, 1 / 2),
        (2, 1 / 3),
    ]
    assert [entry.path for entry in client.list_artifacts(job.id, "tables")] == ["tables/a.csv"]
    assert job.lost == 0


def test_failed_run_names_the_error(uri, client):
    def fail():
        with run(uri, **JOB) as job:
            job.log({"loss": 1.0})
            jobs.append(job)
            raise ValueError("NaN in means\nat step 7")

    jobs = []
    with pytest.raises(ValueError, match="NaN"):
        fail()
    [job] = jobs
    stored = client.get_run(job.id)
    assert stored.info.status == "FAILED"
    assert stored.data.tags["error"] == "ValueError: NaN in means"
    assert stored.data.metrics == {"loss": 1.0}


@pytest.mark.parametrize("signal", [KeyboardInterrupt, SystemExit])
def test_interrupted_run_is_killed(uri, client, signal):
    with pytest.raises(signal), run(uri, **JOB) as job:
        raise signal
    assert client.get_run(job.id).info.status == "KILLED"


def test_metrics_arrive_while_the_job_runs(uri, client, monkeypatch):
    monkeypatch.setattr(record, "SECONDS_BETWEEN_BATCHES", 0)
    with run(uri, **JOB) as job:
        job.log({"loss": 1.0})
        assert client.get_run(job.id).data.metrics == {"loss": 1.0}
        assert client.get_run(job.id).info.status == "RUNNING"


def test_tracking_off_records_nothing_and_loads_nothing():
    code = (
        "import sys\n"
        "from texgs.workflow.tracking import run\n"
        "with run(None, experiment='a', name='b', tags={}, params={}) as job:\n"
        "    job.log({'loss': 1.0}, 3)\n"
        "    job.artifact('image.png', 'images')\n"
        "loaded = {'mlflow', 'sqlalchemy', 'filelock', 'torch'} & set(sys.modules)\n"
        "sys.exit(f'{loaded} {job.id} {job.lost}')"
    )
    assert python(code).stderr == "set() None 0\n"


def test_nothing_is_printed_and_no_usage_reported(uri):
    code = (
        "import sys\n"
        "from texgs.workflow.tracking import run\n"
        "with run(sys.argv[1], experiment='a', name='b', tags={}, params={'long': 'x' * 9000}) as job:\n"
        "    job.log({'loss': 1.0})\n"
        "    job.artifact('README.md')\n"
        "from mlflow.telemetry import get_telemetry_client\n"
        "sys.exit(get_telemetry_client() is not None)"
    )
    child = python(code, uri)
    assert (child.returncode, child.stdout, child.stderr) == (0, "", "")


def test_environment_and_loggers_are_as_before(uri, monkeypatch):
    monkeypatch.setenv("MLFLOW_HTTP_REQUEST_TIMEOUT", "77")
    chatty = logging.getLogger("mlflow")
    chatty.setLevel(logging.DEBUG)
    before = dict(os.environ)
    with run(uri, **JOB):
        assert dict(os.environ) == before
    assert dict(os.environ) == before
    assert chatty.level == logging.DEBUG


def test_store_that_comes_back_gets_everything(uri, client, lost_store, warnings, tmp_path, monkeypatch):
    monkeypatch.setattr(record, "SECONDS_BETWEEN_BATCHES", 0)
    (tmp_path / "a.txt").write_text("a")
    with run(uri, **JOB) as job:
        lost_store(job)
        job.log({"loss": 3.0}, 0)
        job.artifact(tmp_path / "a.txt")
        lost_store(job, is_lost=False)
    assert client.get_run(job.id).data.metrics == {"loss": 3.0}
    assert [entry.path for entry in client.list_artifacts(job.id)] == ["a.txt"]
    assert (job.lost, warnings()) == (0, [])


def test_batch_that_is_sent_twice_is_kept_once(uri, client, monkeypatch):
    monkeypatch.setattr(record, "SECONDS_BETWEEN_BATCHES", 0)
    with run(uri, **JOB) as job:
        send = job._client.log_batch

        def send_without_an_answer(*arguments, **metrics):
            send(*arguments, **metrics)
            raise TimeoutError("no answer")

        monkeypatch.setattr(job._client, "log_batch", send_without_an_answer)
        job.log({"loss": 3.0}, 0)
        monkeypatch.setattr(job._client, "log_batch", send)
    assert [metric.value for metric in client.get_metric_history(job.id, "loss")] == [3.0]
    assert job.lost == 0


def test_lost_store_is_one_warning_and_no_error(uri, lost_store, warnings, tmp_path):
    (tmp_path / "a.txt").write_text("a")
    with run(uri, **JOB) as job:
        lost_store(job)
        job.log({"loss": 3.0, "psnr": 20}, 0)
        job.artifact(tmp_path / "a.txt")
    assert job.lost == 3
    [line] = warnings()
    assert line == (
        f"tracking: run {job.id} in {uri} is incomplete, 3 metrics and files are missing "
        "(the server hung up); the results of the job are not affected"
    )


def test_lost_store_does_not_hide_the_error_of_the_job(uri, lost_store, warnings):
    def fail():
        with run(uri, **JOB) as job:
            lost_store(job)
            raise ValueError("NaN in means")

    with pytest.raises(ValueError, match="NaN in means"):
        fail()
    [line] = warnings()
    assert "is incomplete, 0 metrics and files are missing (the server hung up)" in line


def test_lost_store_does_not_fill_the_memory(uri, client, monkeypatch, warnings):
    monkeypatch.setattr(record, "MOST_METRICS_KEPT", 10)
    with run(uri, **JOB) as job:
        for step in range(25):
            job.log({"loss": step}, step)
    assert job.lost == 15
    assert [metric.step for metric in client.get_metric_history(job.id, "loss")] == list(range(15, 25))
    assert "15 metrics and files are missing (the store was away for too long)" in warnings()[0]


def test_slow_store_costs_a_tenth_of_the_time(uri, monkeypatch):
    now = [0.0]
    monkeypatch.setattr(record.time, "monotonic", lambda: now[0])
    sent = []

    def slow(*_, **__):
        sent.append(now[0])
        now[0] += 3

    with run(uri, **JOB) as job:
        monkeypatch.setattr(job._client, "log_batch", slow)
        while now[0] < 100:
            job.log({"loss": 1.0})
            now[0] += 1
    assert sent == [10, 43, 76, pytest.approx(100, abs=3)]


def test_mistakes_are_named(uri, client, tmp_path):
    for wrong in ("file:./mlruns", "results", "databricks", "postgresql://me:secret@host/db"):
        with pytest.raises(ArgumentError, match=r"expected sqlite:///PATH or the http address") as caught:
            run(wrong, **JOB).__enter__()
        assert "secret" not in str(caught.value)
    with pytest.raises(ArgumentError, match=r"none\.png: no such file"), run(uri, **JOB) as job:
        job.artifact(tmp_path / "none.png")
    client.delete_experiment(client.get_run(job.id).info.experiment_id)
    with pytest.raises(
        TrackingError, match=r"'texgs' was deleted .*mlflow experiments restore --experiment-id 1"
    ):
        run(uri, **JOB).__enter__()
