import contextlib
import os
import socket
import subprocess
import sys
import time
import urllib.request

import pytest

from tests.refusals import refused
from tests.track.eight import assert_eight_jobs_lose_nothing
from texgs.workflow.runs import TrackingError, begin, run

pytestmark = pytest.mark.subprocess

JOB = {"experiment": "texgs", "name": "fit", "tags": {}, "params": {}}


def free_port():
    with contextlib.closing(socket.socket()) as server:
        server.bind(("127.0.0.1", 0))
        return server.getsockname()[1]


def is_healthy(address):
    try:
        with urllib.request.build_opener(urllib.request.ProxyHandler({})).open(f"{address}/health") as answer:
            return answer.status == 200
    except OSError:
        return False


@pytest.fixture
def server(database, tmp_path, monkeypatch):
    """Address and process of an MLflow server with a store of its own."""
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")
    port = free_port()
    address = f"http://127.0.0.1:{port}"
    command = [sys.executable, "-P", "-m", "mlflow", "server", "--workers", "1"]
    command += ["--host", "127.0.0.1", "--port", str(port), "--backend-store-uri", f"sqlite:///{database}"]
    command += ["--artifacts-destination", str(tmp_path / "files")]
    environment = os.environ | {
        "MLFLOW_DISABLE_TELEMETRY": "true",
        "MLFLOW_SERVER_ENABLE_JOB_EXECUTION": "false",
    }
    with (tmp_path / "server.log").open("wb") as log:
        process = subprocess.Popen(command, stdout=log, stderr=log, env=environment, start_new_session=True)
    try:
        deadline = time.monotonic() + 300
        while not is_healthy(address):
            assert process.poll() is None, (tmp_path / "server.log").read_text()
            assert time.monotonic() < deadline, "the server did not start within five minutes"
            time.sleep(0.1)
        yield address, process
    finally:
        stop(process)


def stop(process):
    """End the server and its workers, which share its session."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, 9)
    process.wait()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="the jobs are forked")
def test_eight_jobs_and_then_the_server_dies(server, tmp_path, warnings, capfd):
    address, process = server
    assert_eight_jobs_lose_nothing(tmp_path, address)
    capfd.readouterr()

    with run(address, **JOB) as job:
        job.log({"loss": 1.0}, 0)
        stop(process)
        start = time.monotonic()
        for step in range(1, 6):
            job.log({"loss": 1.0}, step)
        job.artifact(__file__)
    assert time.monotonic() - start < 10
    [line] = warnings()
    assert "is incomplete" in line
    assert "Connection refused" in line or "Connection reset" in line  # by a socket that is not closed yet
    assert capfd.readouterr() == ("", "")


def test_server_that_is_not_there_is_one_sentence(monkeypatch):
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")
    address = f"http://me:secret@127.0.0.1:{free_port()}"
    start = time.monotonic()
    with pytest.raises(TrackingError, match=r"cannot be used .*Connection refused.*; check it") as caught:
        begin(address, **JOB)
    assert time.monotonic() - start < 10
    assert "secret" not in str(caught.value)
    assert "\n" not in str(caught.value)


def test_server_that_never_answers_is_given_up(monkeypatch):
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")
    monkeypatch.setenv("MLFLOW_HTTP_REQUEST_TIMEOUT", "1")
    with contextlib.closing(socket.socket()) as silent:
        silent.bind(("127.0.0.1", 0))
        silent.listen()
        start = time.monotonic()
        refused(
            lambda: begin(f"http://127.0.0.1:{silent.getsockname()[1]}", **JOB),
            r"cannot be used .*timed out",
            TrackingError,
        )
    assert time.monotonic() - start < 5  # one second, and one more try
