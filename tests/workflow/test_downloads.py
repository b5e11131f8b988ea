"""Volumes are downloaded where Snakemake runs, by a rule before the jobs that read them."""

import hashlib
import threading
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

import numpy as np
import pytest

from tests.workflow.project import Project

pytestmark = pytest.mark.workflow

VOLUME = "results/turbulence/volume/metrics.json"


@pytest.fixture
def source(tmp_path):
    """Overrides for a volume that a server has."""
    folder = tmp_path / "served"
    folder.mkdir()
    np.save(folder / "a.npy", np.linspace(0, 1, 16**3, dtype=np.float32).reshape(16, 16, 16))
    sha256 = hashlib.sha256((folder / "a.npy").read_bytes()).hexdigest()
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(SimpleHTTPRequestHandler, directory=folder))
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    yield (
        "dataset.volume.generator=null dataset.volume.file=a.npy "
        f"dataset.volume.url=http://127.0.0.1:{server.server_port}/a.npy dataset.volume.sha256={sha256}"
    )
    server.shutdown()
    server.server_close()
    thread.join()


def test_a_volume_is_downloaded_by_a_job_of_its_own(source, tmp_path, monkeypatch):
    monkeypatch.setenv("TEXGS_CACHE", str(tmp_path / "cache"))
    project = Project(tmp_path)
    assert project.planned(targets=(VOLUME,), overrides=source) == ["download", "volume"]
    done = project.snakemake(targets=("downloads",), overrides=source)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "localrule download:" in done.stdout + done.stderr
    (file,) = (tmp_path / "cache" / "volumes").rglob("a.npy")
    at = file.stat().st_mtime_ns
    assert project.planned(targets=(VOLUME,), overrides=source) == ["volume"]
    done = project.snakemake(targets=(VOLUME,), overrides=source)
    assert done.returncode == 0, done.stdout + done.stderr
    assert (project.work / VOLUME).exists()
    assert file.stat().st_mtime_ns == at
    assert project.planned(targets=(VOLUME,), overrides=source) == []


def test_a_download_that_fails_ends_the_run_with_its_reason(source, tmp_path, monkeypatch):
    monkeypatch.setenv("TEXGS_CACHE", str(tmp_path / "cache"))
    project = Project(tmp_path)
    done = project.snakemake(targets=(VOLUME,), overrides=source.replace("/a.npy ", "/none.npy "))
    assert done.returncode == 1
    last = done.stderr.splitlines()[-1]
    assert last.startswith("texgs download: http://127.0.0.1:")
    assert last.endswith("get a.npy elsewhere and name its folder by data_folder=FOLDER or TEXGS_DATA")
