"""The profile on a real SLURM with one node: to the views and one fit, cancelled, killed, resumed."""

import os
import signal
import subprocess
import sys
import time
from importlib.util import find_spec
from pathlib import Path

import pytest

from tests.cluster.slurm import missing, processes_below, running

ROOT = Path(__file__).parents[2]

# One TF, 42 views: long enough for a job to be cancelled in the middle of them.
SMALL = (
    "dataset.volume.size=24 ~dataset.basic_tfs.TF02 dataset.title=$HOME "
    "views=small views.width=128 views.height=128 views.step=0.1 views.test.count=2 views.turntable=2 "
    "fit=demo fit.surfels.iterations=40 fit.shading.iterations=40"
)
FIT = "results/turbulence/TF01/demo/texture/metrics.json"


@pytest.fixture(scope="module")
def slurm(tmp_path_factory):
    if not os.environ.get("TEXGS_TEST_CLUSTER"):
        pytest.skip("a real SLURM is started by `make test-cluster` alone")
    if names := missing():
        pytest.skip(f"{', '.join(names)}: not installed; apt-get install slurmctld slurmd slurm-client")
    if find_spec("snakemake_executor_plugin_slurm") is None:
        pytest.skip("snakemake-executor-plugin-slurm is not installed; pip install '.[cluster]'")
    folder = tmp_path_factory.mktemp("slurm")
    with running(folder) as cluster:
        yield cluster
    assert processes_below(folder) == [], "a daemon is left"


@pytest.fixture(scope="module")
def work(tmp_path_factory):
    return tmp_path_factory.mktemp("work with a space")


@pytest.fixture
def start(slurm, work):
    """Starts Snakemake as on a login node; it is ended with the test."""
    started = []

    def snakemake(*words, overrides=SMALL):
        command = [sys.executable, "-m", "snakemake", "--snakefile", ROOT / "Snakefile", "--directory", work]
        command += ["--workflow-profile", ROOT / "workflow" / "profiles" / "slurm"]
        command += ["--slurm-status-command", "squeue"]  # there is no accounting
        command += ["--slurm-init-seconds-before-status-checks", "4", "--latency-wait", "5"]
        command += [*words, "--config", "tracking=none", f"overrides={overrides}"]
        said = (work / f"said-{len(list(work.glob('said-*')))}").open("w+")
        process = subprocess.Popen(command, env=slurm.environment, stdout=said, stderr=said)
        process.said = Path(said.name)
        started.append(process)
        return process

    yield snakemake
    for process in started:
        if process.poll() is None:
            process.kill()
        process.wait()


def wait_for(condition, process, seconds=240):
    """The first value that is true, as long as the process lives."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        if value := condition():
            return value
        assert process.poll() is None, process.said.read_text()
        time.sleep(0.1)
    raise AssertionError(f"nothing within {seconds} s: {process.said.read_text()}")


def images(folder):
    """When each training view below a folder was written."""
    return {path.name: path.stat().st_mtime_ns for path in folder.rglob("train/r_*.png")}


def some_images(folder):
    """The same, once there are a few."""
    times = images(folder)
    return times if len(times) >= 3 else {}


def text_of(log):
    """What a log says; Snakemake removes it before a job begins."""
    try:
        return log.read_text()
    except FileNotFoundError:
        return ""


def test_a_cancelled_job_goes_on_in_a_run_to_the_first_fit(slurm, work, start):
    tf = work / "results" / "turbulence" / "TF01"
    process = start("volumes", "sheets", FIT)
    before = wait_for(lambda: some_images(tf), process)
    (job,) = slurm.jobs("running")
    slurm.call("scancel", job)
    wait_for(lambda: job not in slurm.jobs("running", "completing"), process)
    kept = images(tf)
    assert 3 <= len(before) <= len(kept) < 42

    retry = wait_for(lambda: slurm.jobs("running", "pending"), process)
    (memory,) = slurm.call("squeue", "--noheader", f"--job={next(iter(retry))}", "--format=%m").split()
    assert memory in ("16000M", "15.625G"), "a second attempt asks for twice as much"

    assert process.wait(timeout=400) == 0, process.said.read_text()
    assert (work / FIT).exists()
    assert (tf / "sheet" / "sheet.png").exists()
    assert len(images(tf)) == 42
    assert kept.items() <= images(tf).items(), "the views of the cancelled job are made again"
    assert slurm.jobs("running", "pending") == {}
    assert processes_below(work) == []

    submitted = sorted(slurm.jobs().values())
    assert len(submitted) == 1 + 2 + 3, (
        f"volume and transfer, views and sheet twice, three phases: {submitted}"
    )
    cores = slurm.call("squeue", "--noheader", "--states=all", "--format=%C").split()
    assert max(map(int, cores)) <= 8, "more cores than many nodes have"
    (settings,) = (work / "results" / ".conf").glob("transfer-*.yaml")
    assert "$HOME" in settings.read_text(), "what a shell would make of $HOME is no title"


def test_a_job_outlives_the_login_process_and_is_adopted(slurm, work, start):
    other = f"{SMALL} views.name=views-b views.lights=[{{kind:directional,azimuth:60,polar:20}}]"
    target = "results/turbulence/TF01/views-b/metrics.json"
    log = work / "results" / "logs" / "turbulence" / "TF01" / "views-b.log"
    tf = work / "results" / "turbulence" / "TF01"
    already = set(slurm.jobs())
    process = start(target, overrides=other)

    def views_b():
        return {name: at for folder in tf.glob("*views-b*") for name, at in images(folder).items()}

    wait_for(lambda: len(views_b()) >= 3, process)
    (survivor,) = slurm.jobs("running")
    slurm.call("scontrol", "suspend", survivor)  # so that it still holds its folder when the next job comes
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    kept = views_b()
    assert 3 <= len(kept) < 42

    again = start(target, overrides=other)
    wait_for(lambda: "another job works there; waiting for it to end" in text_of(log), again)
    slurm.call("scontrol", "resume", survivor)
    assert again.wait(timeout=400) == 0, again.said.read_text()
    assert len(views_b()) == 42
    assert kept.items() <= views_b().items(), "the views of the job that outlived its run are made again"
    states = slurm.call("squeue", "--noheader", "--states=all", "--format=%A %T").splitlines()
    ends = dict(line.split() for line in states)
    assert {ends[job] for job in set(ends) - already} == {"COMPLETED"}
    assert processes_below(work) == []
