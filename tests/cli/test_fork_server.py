"""The server that forks jobs: a forked job is what a started program would be."""

import os
import subprocess
import sys
import time

import pytest

from texgs.cli import fork_client, fork_server

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the fork server is for Linux")

# A server whose jobs run their first word as Python, instead of texgs.
SERVER = """
import socket, sys
from texgs.cli.fork_server import run, serve
with socket.socket(fileno=int(sys.argv[1])) as listener:
    request = serve(listener, 0)
if request is not None:
    run(request, lambda: exec(request.arguments[0], {}) or 0)
"""
SAY = "import os, sys; print(os.getcwd(), os.environ['WORD'], os.environ.get('OTHER')); sys.exit(3)"
WAIT = """
import pathlib, time
print('ready', flush=True)
while not pathlib.Path('go').exists():
    time.sleep(.01)
pathlib.Path('published').touch()
"""


@pytest.fixture
def server(monkeypatch):
    """A running server; the environment of the test names it."""
    start = subprocess.Popen

    def popen(words, **options):
        return start([words[0], "-c", SERVER, words[4]], **options)

    monkeypatch.setenv("OTHER", "of the server")
    monkeypatch.setattr(fork_server.subprocess, "Popen", popen)
    process = fork_server.start({})
    monkeypatch.setattr(fork_server.subprocess, "Popen", start)
    monkeypatch.setenv(fork_server.ADDRESS, os.environ[fork_server.ADDRESS])  # goes with the test
    monkeypatch.delenv("OTHER")
    yield process
    process.kill()
    process.communicate()


def client(*words, **options):
    command = [sys.executable, "-PSE", fork_client.__file__, *words]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **options)


def test_a_job_has_its_own_folder_environment_output_and_exit_code(server, tmp_path):
    done = client(SAY, cwd=tmp_path, env={**os.environ, "WORD": "blue"})
    out, err = done.communicate(timeout=60)
    assert (out, err, done.returncode) == (f"{tmp_path} blue None\n", "", 3)


def test_jobs_run_side_by_side(server, tmp_path):
    first = client(WAIT, cwd=tmp_path)
    second = client("open('go', 'w')", cwd=tmp_path)
    assert second.wait(60) == 0
    assert first.wait(60) == 0


def test_a_mistake_and_a_crash_are_told(server):
    mistake = client("raise ValueError('a mistake')")
    out, err = mistake.communicate(timeout=60)
    assert (mistake.returncode, out) == (1, "")
    assert "ValueError: a mistake" in err
    crash = client("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)")
    assert "crashed or was killed" in crash.communicate(timeout=60)[1]
    assert crash.returncode == 1
    assert client("pass").wait(60) == 0  # the server goes on


def test_a_job_ends_where_its_client_is_killed(server, tmp_path):
    job = """
import pathlib, signal, sys, time
def end(*_):
    pathlib.Path('ended').write_text('SIGTERM'); sys.exit()
signal.signal(signal.SIGTERM, end)
print('ready', flush=True)
time.sleep(60)
"""
    killed = client(job, cwd=tmp_path)
    assert killed.stdout.readline() == "ready\n"
    killed.kill()
    assert killed.stdout.read() == ""  # the job has closed it, too
    assert (tmp_path / "ended").read_text() == "SIGTERM"


def test_a_job_ends_where_its_server_is_killed(server, tmp_path):
    """Else the orphan would publish what Snakemake makes again, with two finished runs."""
    orphan = client(WAIT, cwd=tmp_path)
    assert orphan.stdout.readline() == "ready\n"
    server.kill()
    assert orphan.wait(60) == 1
    (tmp_path / "go").touch()
    time.sleep(0.2)
    assert not (tmp_path / "published").exists()


def test_jobs_that_run_end_before_their_server(server, tmp_path):
    job = client(WAIT, cwd=tmp_path)
    assert job.stdout.readline() == "ready\n"
    server.stdin.close()  # as when the run is killed
    time.sleep(0.1)
    assert server.poll() is None
    (tmp_path / "go").touch()
    assert job.wait(60) == 0
    assert server.wait(60) == 0


def test_without_a_server_the_client_becomes_the_job(monkeypatch):
    monkeypatch.delenv(fork_server.ADDRESS, raising=False)
    out, _ = client("--version").communicate(timeout=60)
    assert out.startswith("texgs ")
    monkeypatch.setenv(fork_server.ADDRESS, "texgs-that-is-gone")
    assert client("--version").communicate(timeout=60)[0] == out


def test_libraries_take_as_many_threads_as_the_job_is_given():
    """In a process of its own, with the libraries that the server of a run has."""
    code = """
import os
os.environ |= {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
import numpy, torch
from threadpoolctl import threadpool_info
from texgs.cli.fork_server import use_threads
use_threads(3)
print(torch.get_num_threads(), {pool["num_threads"] for pool in threadpool_info()})
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "3 {3}\n"
