"""What a run holds, and how it ends."""

import math
import subprocess
import sys
import time
from contextlib import nullcontext
from pathlib import Path

import mlflow
import pytest

from tests.refusals import refused
from texgs.workflow import runs
from texgs.workflow.runs import OUTPUT, TrackingError, begin, run

ROOT = Path(__file__).parents[2]
JOB = {"experiment": "texgs", "name": "fit", "tags": {"git.sha": "0f3c"}, "params": {"fit.steps": "7"}}


def lose(monkeypatch):
    """Make the store fail."""

    def refuse(*_, **__):
        raise ConnectionError("the server hung up\nat port 5000")

    for name in ("log_metrics", "log_artifact", "end_run"):
        monkeypatch.setattr(mlflow, name, refuse)


def python(code, *arguments):
    """Output of a child process."""
    code = f"import sys\nfrom texgs.workflow.runs import run\n{code}"
    command = [sys.executable, "-c", code, *arguments]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)


def test_finished_run_holds_everything(uri, client, tmp_path):
    (tmp_path / "tables").mkdir()
    (tmp_path / "tables" / "a.csv").write_text("1")
    with run(uri, **JOB) as job:
        job.log({"psnr": 30, "worst": math.nan, "most": math.inf, "clip@512": 0.3})
        for step in range(3):
            job.log({"loss": 1 / (step + 1)}, step)
        job.tag({"file": "model.safetensors"})
        job.artifact(tmp_path / "tables")
    stored = client.get_run(job.id)
    assert (stored.info.status, stored.info.run_name) == ("FINISHED", "fit")
    assert client.get_experiment(stored.info.experiment_id).name == "texgs"
    assert (stored.data.tags["git.sha"], stored.data.tags["file"]) == ("0f3c", "model.safetensors")
    assert stored.data.params == {"fit.steps": "7"}
    assert (stored.data.metrics["psnr"], stored.data.metrics["clip_512"]) == (30, 0.3)
    assert math.isnan(stored.data.metrics["worst"])
    history = sorted((m.step, m.value) for m in client.get_metric_history(job.id, "loss"))
    assert history == [(0, 1), (1, 1 / 2), (2, 1 / 3)]
    assert [entry.path for entry in client.list_artifacts(job.id, "tables")] == ["tables/a.csv"]
    assert job.trouble is None


@pytest.mark.parametrize(
    ("error", "status", "told"),
    [
        (ValueError("NaN in means\nat step 7"), "FAILED", "ValueError: NaN in means"),
        (KeyboardInterrupt(), "KILLED", None),
        (SystemExit(), "KILLED", None),
    ],
)
def test_a_job_that_raises_ends_its_run(uri, client, error, status, told):
    def work():
        with run(uri, **JOB) as job:
            jobs.append(job)
            job.log({"loss": 1.0})
            raise error

    jobs = []
    with pytest.raises(type(error)):
        work()
    [job] = jobs
    stored = client.get_run(job.id)
    assert (stored.info.status, stored.data.tags.get("error")) == (status, told)
    assert stored.data.metrics == {"loss": 1.0}


def test_metrics_arrive_while_the_job_runs(uri, client, monkeypatch):
    monkeypatch.setenv("MLFLOW_ASYNC_LOGGING_BUFFERING_SECONDS", "1")
    with run(uri, **JOB) as job:
        start = time.monotonic()
        job.log({"loss": 1.0})
        assert time.monotonic() - start < 1, "the job does not wait for the store"
        while not client.get_run(job.id).data.metrics and time.monotonic() - start < 60:
            time.sleep(0.1)
        assert client.get_run(job.id).data.metrics == {"loss": 1.0}
        assert client.get_run(job.id).info.status == "RUNNING"


def test_tracking_off_records_nothing_and_loads_nothing():
    code = (
        "with run(None, experiment='a', name='b', tags={}, params={}) as job:\n"
        "    job.log({'loss': 1.0}, 3)\n"
        "    job.artifact('image.png', 'images')\n"
        "    job.tag({'file': 'x'})\n"
        "loaded = {'mlflow', 'sqlalchemy', 'filelock', 'torch'} & set(sys.modules)\n"
        "sys.exit(f'{loaded} {job.id}')"
    )
    assert python(code).stderr == "set() None\n"


@pytest.mark.subprocess
def test_nothing_is_printed_and_no_usage_reported(uri):
    code = (
        "with run(sys.argv[1], experiment='a', name='b', tags={}, params={'long': 'x' * 9000}) as job:\n"
        "    job.log({'loss': 1.0})\n"
        "    job.artifact('README.md')\n"
        "from mlflow.telemetry import get_telemetry_client\n"
        "sys.exit(get_telemetry_client() is not None)"
    )
    child = python(code, uri)
    assert (child.returncode, child.stdout, child.stderr) == (0, "", "")


@pytest.mark.parametrize("error", [None, ValueError("NaN in means")])
def test_lost_store_is_one_warning_that_hides_no_error_of_the_job(uri, warnings, monkeypatch, error):
    def work():
        with run(uri, **JOB) as job:
            lose(monkeypatch)
            jobs.append(job)
            job.log({"loss": 3.0, "psnr": 20}, 0)
            job.artifact(__file__)
            if error:
                raise error

    jobs = []
    with pytest.raises(ValueError, match="NaN in means") if error else nullcontext():
        work()
    assert warnings() == [
        f"tracking: run {jobs[0].id} in {uri} is incomplete (the server hung up); "
        "the results of the job are not affected"
    ]


def test_mistakes_are_named(uri, client):
    files = ("sqlite://", "sqlite:///", "sqlite:///:memory:", "sqlite:///a?b=c")
    for wrong in ("file:./mlruns", "results", *files):
        refused(lambda wrong=wrong: begin(wrong, **JOB), r"expected sqlite:///PATH or the http address")
    refused(lambda: begin("postgresql://me:secret@host/db", **JOB), r"got 'postgresql://host/db'")
    client.delete_experiment(client.get_experiment_by_name("elsewhere").experiment_id)
    refused(lambda: begin(uri, **{**JOB, "experiment": "elsewhere"}), "elsewhere", TrackingError)


def test_the_same_key_goes_on_with_the_same_run(uri, client):
    whole = begin(uri, **JOB, key="k")
    whole.end("FAILED")
    again, other = begin(uri, **{**JOB, "tags": {"git.sha": "9"}}, key="k"), begin(uri, **JOB, key="l")
    assert again.id == whole.id != other.id
    stored = client.get_run(whole.id)
    assert (stored.info.status, stored.data.tags["git.sha"]) == ("RUNNING", "9")


def test_a_run_ends_those_of_its_folder_that_a_killed_process_has_left(uri, client):
    """The killed process holds the lock of its folder no more."""
    folders = ("/results/a", "/results", "/results/a/b", "/elsewhere/a", "/results2")
    left = [client.create_run("1", tags={OUTPUT: folder}).info.run_id for folder in folders]
    own = begin(uri, **{**JOB, "experiment": "elsewhere", "tags": {OUTPUT: "/results/a"}})
    statuses = [client.get_run(id).info.status for id in (*left, own.id)]
    assert statuses == ["KILLED", "RUNNING", "KILLED", "RUNNING", "RUNNING", "RUNNING"]
    begin(uri, **{**JOB, "experiment": "elsewhere", "tags": {OUTPUT: "/results"}})
    assert [client.get_run(id).info.status for id in left[1:]] == ["KILLED", "KILLED", "RUNNING", "RUNNING"]


def test_names():
    names = ("wildcards.dataset", "psnr/TF01", "clip@512", "../a//b/", "")
    assert [*map(runs.allowed_name, names)] == ["wildcards.dataset", "psnr/TF01", "clip_512", "a/b", "_"]


def test_every_name_is_one_that_mlflow_takes(uri):
    """Of each kind of character, alone, in a path and at its ends; and long ones."""
    texts = [chr(code) for code in (*range(256), 0x3B2, 0x200B, 0x1F600)] + ["x" * 300, "a/" * 200]
    with run(uri, **JOB) as job:
        for text in texts:
            job.log(dict.fromkeys((text, f"a/{text}", f"{text}/a", f"{text} a"), 0.0))
    assert job.trouble is None
