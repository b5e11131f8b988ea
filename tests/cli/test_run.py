"""`texgs run`: which words are of the configuration and which of snakemake, exit codes, Ctrl-C."""

import contextlib
import errno
import os
import re
import shlex
import signal
import subprocess
import sys
import time
from types import SimpleNamespace

import pytest
from snakemake.api import SnakemakeApi
from snakemake.cli import parse_config
from snakemake_interface_logger_plugins.common import LogEvent

from tests.refusals import refused
from tests.workflow.project import TINY
from texgs.cli.run import WORD, snakemake
from texgs.cli.run_log import LogHandler
from texgs.cli.snakemake import last_line, overrides, place_errors
from texgs.core.errors import ArgumentError

TEXGS = [sys.executable, "-m", "texgs.cli.main"]


def test_words_of_the_configuration_and_targets():
    assert all(
        map(WORD.fullmatch, ["dataset=engine", "views.width=4", "+a.b=1", "++a=1", "~a.b", "edits=[x,y]"])
    )
    targets = "volumes results/report.html results/a=b/c.png /tmp/x=y 2=3"
    assert not any(map(WORD.fullmatch, targets.split()))


def test_any_value_reaches_the_snakefile():
    words = ["a=$HOME `x` $(y)", "b=[1, {c: 'd'}]", 'c="quoted"', "d='", 'e="', "f=#: -", "g=é \U0001f600"]
    words += ["h=\n\\"]
    (entry,) = overrides(words, ())
    assert shlex.split(parse_config([entry])["overrides"]) == words
    assert overrides([], ()) == []


@pytest.mark.parametrize(
    ("entry", "named"),
    [("overrides=views=small", "give its words to texgs run"), ("engine", "--config: .* got engine")],
)
def test_what_snakemake_would_read_otherwise_is_told(entry, named):
    refused(lambda: overrides(["dataset=engine"], [entry]), named)


@pytest.mark.workflow
@pytest.mark.parametrize(
    ("words", "profile"),
    [
        (["-n"], ""),
        (["-n", "--workflow-profile", "slurm"], "profiles/slurm for"),
        (["-n", "--workflow-profile=none"], ""),
    ],
)
def test_a_profile_that_is_asked_for_is_named(tmp_path, words, profile):
    done = texgs(tmp_path, "run", *words, "nonsense=1")
    assert done.returncode == 2
    assert profile in done.stderr
    assert ("Using" in done.stderr) == bool(profile)


def texgs(folder, *words, **options):
    return subprocess.run(
        [*TEXGS, *words], cwd=folder, capture_output=True, text=True, timeout=300, **options
    )


@pytest.mark.workflow
def test_a_dry_run_with_words_anywhere(tmp_path):
    done = texgs(tmp_path, "run", "-n", "tracking=none", "--cores", "1", *TINY.split(), "volumes", "tf=TF01")
    assert done.returncode == 0, done.stderr
    counts = dict(re.findall(r"^(\w+) +(\d+)$", done.stdout + done.stderr, re.MULTILINE))
    assert counts == {"volume": "1", "transfer": "1", "volumes": "1", "total": "3"}
    assert "rule transfer" not in done.stdout + done.stderr
    assert not list(tmp_path.glob("results/turbulence"))


@pytest.mark.workflow
@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["nonsense=1"], "texgs: nonsense: no such key"),
        (["--set-threads", "edit=2", "fit.seed=3"], "run: fit.seed=3: the option before takes it"),
        (["--resources", "mem_mb=100", "dataset=sphere"], "which is not an integer; see snakemake --help"),
        (["--workflow-profile=slrum"], "--workflow-profile: expected local, slurm or a folder, got slrum"),
        (["reprot"], "texgs run: reprot: no such target, did you mean report?"),
        (["dataset", "engine"], "dataset: expected dataset=engine in one word, got dataset alone"),
        (["edits=glass"], "texgs: edits: expected a list, [glass], got 'glass'"),
    ],
)
def test_mistakes_end_with_2(tmp_path, words, message):
    done = texgs(tmp_path, "run", "-n", *words)
    assert done.returncode == 2
    assert message in done.stderr + done.stdout
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("dataset=lung fit=quick", "dataset=lung: this folder has no conf/, so it is no project: cd PROJECT"),
        ("experiment=mine -n", "experiment=mine: this folder has no conf/"),
        ("dataset=ENGINE", "got ENGINE, did you mean engine? (this folder has no conf/, so it is no project"),
        (f"dataset={'x' * 300}", "this folder has no conf/"),
    ],
)
def test_a_mistake_outside_of_a_project_leaves_nothing(tmp_path, words, message):
    done = texgs(tmp_path, "run", *words.split())
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert message in done.stderr
    assert not [*tmp_path.iterdir()]


@pytest.mark.workflow
def test_a_run_outside_of_a_project_says_so(tmp_path):
    words = ["run", "-n", "tracking=none", *TINY.split(), "volumes", "tf=TF01"]
    told = "texgs: this folder has no conf/, so it is no project: cd PROJECT, or start one"
    assert told in texgs(tmp_path, *words).stderr
    (tmp_path / "conf" / "dataset").mkdir(parents=True)
    (tmp_path / "below").mkdir()
    assert "no project" not in texgs(tmp_path, *words).stderr
    assert f"cd {tmp_path}, or start one" in texgs(tmp_path / "below", "views", "dataset=lung").stderr


@pytest.mark.workflow
@pytest.mark.parametrize(
    ("place", "home"), [(".snakemake", ""), ("results/turbulence", ""), ("home", "home")]
)
def test_a_place_that_cannot_be_used_is_one_sentence(tmp_path, place, home):
    """As where it is read-only, which root may write to all the same."""
    (tmp_path / place).parent.mkdir(exist_ok=True)
    (tmp_path / place).touch()
    environment = {**os.environ, **({"HOME": str(tmp_path / home), "XDG_CACHE_HOME": ""} if home else {})}
    done = texgs(tmp_path, "run", "--cores", "1", "tracking=none", *TINY.split(), "volumes", env=environment)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert place in done.stderr.splitlines()[-1]
    assert "the run cannot work there (" in done.stderr.splitlines()[-1]


@pytest.mark.workflow
def test_a_run_that_is_interrupted_says_that_it_goes_on(tmp_path):
    long = "views.train.frequency=3 views.width=300 views.height=300 views.step=0.1"
    words = ["run", "--cores", "1", "tracking=none", *TINY.split(), *long.split(), "sheets"]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    process = subprocess.Popen([*TEXGS, *words], cwd=tmp_path, text=True, start_new_session=True, **pipes)
    deadline = time.monotonic() + 200
    while not list(tmp_path.glob("results/logs/turbulence/*/views.log")) and process.poll() is None:
        assert time.monotonic() < deadline
        time.sleep(0.05)
    os.kill(process.pid, signal.SIGINT)  # to the run alone, which now waits for its job
    time.sleep(1)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does for Ctrl-C
    _, err = process.communicate(timeout=100)
    assert process.returncode == 130
    assert err.splitlines()[-1] == "texgs run: interrupted; the same command goes on with what is not done"
    assert "Traceback" not in err
    assert "Error in rule" not in err, "jobs that were interrupted have no fault"


@pytest.mark.workflow
@pytest.mark.parametrize(("words", "also"), [(["-n"], None), (["-n"], subprocess.STDOUT), ([], None)])
def test_jobs_go_on_where_nobody_reads_their_output(tmp_path, words, also):
    """As `| head -0` leaves it; the run tells by its exit code what has come of it."""
    read, write = os.pipe()
    os.close(read)
    words = ["run", "--cores", "1", *words, "tracking=none", *TINY.split(), "volumes"]
    done = subprocess.run(
        [*TEXGS, *words], cwd=tmp_path, stdout=write, stderr=also or subprocess.PIPE, text=True, timeout=300
    )
    os.close(write)
    assert done.returncode == 141, done.stderr
    assert "roken pipe" not in (done.stderr or "")
    is_real = "-n" not in words
    assert bool(list(tmp_path.glob("results/turbulence/volume/metrics.json"))) == is_real
    if is_real:
        assert "1 of 1 slab" in (tmp_path / "results/logs/turbulence/volume.log").read_text()


def test_a_profile_of_another_program_is_named(tmp_path):
    (tmp_path / "config.yaml").write_text("executor: nowhere\n")
    done = texgs(tmp_path, "run", "-n", env={**os.environ, "SNAKEMAKE_PROFILE": str(tmp_path)})
    assert done.returncode == 2
    told = f"snakemake: {tmp_path} of SNAKEMAKE_PROFILE: argument --executor/-e: invalid choice: 'nowhere'"
    assert done.stderr.splitlines()[-1].startswith(told)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (
            'Traceback (most recent call last):\n  File "a.py", line 3, in run\n    f()\n'
            '  File "b.py", line 7, in f\n    x.y\n    ^^^\nAttributeError: no y\n',
            "b.py, line 7: AttributeError: no y",
        ),
        (
            "50 %\ntexgs views: views.width: expected at least 1, got 0\n\n",
            "texgs views: views.width: expected at least 1, got 0",
        ),
        ("texgs views: interrupted; the same command goes on", ""),
        ("", ""),
    ],
)
def test_the_reason_of_a_failed_job_names_its_place(tmp_path, text, told):
    (tmp_path / "log").write_text(text)
    assert last_line(tmp_path / "log") == told
    assert last_line(tmp_path / "none") == ""


def test_a_user_without_a_home_folder_is_told_so(monkeypatch):
    monkeypatch.setattr("pwd.getpwuid", {}.__getitem__)
    for name in ("HOME", "XDG_CONFIG_HOME"):
        monkeypatch.delenv(name, raising=False)
    refused(lambda: snakemake(["-n"]), "HOME: snakemake needs a home folder")


def test_a_full_temporary_folder_is_named():
    told = r"the temporary folder: the run cannot work there \(No space left on device\); make room"
    with pytest.raises(ArgumentError, match=told), place_errors():
        SnakemakeApi.print_exception(None, OSError(errno.ENOSPC, "No space left on device"))


@pytest.mark.workflow
def test_a_run_for_one_target_names_no_report(tmp_path):
    """In a project whose path has what shells, addresses and SQL take for something else."""
    project = tmp_path / """it's of "both" kinds?"""
    project.mkdir()
    words = ["run", "--cores", "1", "tracking=mlflow", *TINY.split(), "volumes"]
    done = texgs(project, *words)
    assert done.returncode == 0, done.stderr
    assert "Done: what was asked for" in done.stdout
    assert "report.html" not in done.stdout


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Errors of a run whose second job fails, and those of the same with `--verbose`; the folder."""
    folder = tmp_path_factory.mktemp("runs")
    (folder / "conf").mkdir()
    (folder / "results/turbulence/transfer").mkdir(parents=True)
    (folder / "results/turbulence/transfer/mine.txt").touch()
    words = ["run", "--cores", "1", "tracking=none", *TINY.split(), "volumes"]
    return texgs(folder, *words), texgs(folder, *words, "--verbose"), folder, words


@pytest.mark.workflow
def test_without_a_terminal_there_are_plain_lines_and_errors_in_whole(runs):
    plain, verbose, _, _ = runs
    assert plain.returncode == verbose.returncode == 1
    lines = [" ".join(line.split()) for line in plain.stderr.splitlines()]
    assert lines[:-2] == [
        "volume turbulence started",
        *(line for line in lines if line.startswith("1 of 2 volume turbulence ")),
        "transfer turbulence started",
    ]
    assert lines[-2] == "failed transfer turbulence see results/logs/turbulence/transfer.log"
    reason = verbose.stderr.splitlines()[-1]
    assert lines[-1] == reason.strip()
    assert "\x1b" not in plain.stderr
    assert "rule transfer:" in verbose.stderr
    assert "1 of 2 steps" not in plain.stderr


@pytest.mark.workflow
def test_a_profile_decides_on_the_log_too(runs):
    _, _, folder, words = runs
    profile = folder / "silent"
    profile.mkdir()
    (profile / "profile.yaml").write_text("quiet: [all]\n")
    done = texgs(folder, *words, "--profile", str(profile))
    assert done.returncode == 1
    assert "started" not in done.stderr


def test_what_a_cluster_says_of_a_failed_job_is_told(tmp_path, capsys):
    """A job that is killed has nothing in its log."""
    handler, log = LogHandler(SimpleNamespace(), None), tmp_path / "phase.log"
    handler._jobs[7] = SimpleNamespace(rule_name="phase", wildcards={"tf": "TF01"})
    record = SimpleNamespace(
        event=LogEvent.JOB_ERROR, jobid=7, log=[str(log)], rule_msg="SLURM: OUT_OF_MEMORY"
    )
    handler.emit(record)
    lines = [line.split() for line in capsys.readouterr().err.splitlines()]
    assert lines == [["failed", "phase", "TF01", "see", str(log)], ["SLURM:", "OUT_OF_MEMORY"]]


def test_a_line_that_cannot_be_written_ends_no_log(tmp_path, capsys):
    """Here of a job whose numbers are cut off."""
    handler, metrics = LogHandler(SimpleNamespace(), None), tmp_path / "metrics.json"
    metrics.write_text("{")
    job = SimpleNamespace(rule_name="views", wildcards={}, output=[str(metrics)], log=[], created=0)
    handler._jobs[7] = job
    handler.emit(SimpleNamespace(event=LogEvent.JOB_FINISHED, job_id=7, msg="", args=()))
    assert "metrics.json" in capsys.readouterr().err


@pytest.mark.workflow
def test_a_terminal_gets_bars(runs):
    _, _, folder, words = runs
    main, other = os.openpty()
    process = subprocess.Popen([*TEXGS, *words], cwd=folder, stdout=subprocess.PIPE, stderr=other)
    os.close(other)
    told = b""
    with contextlib.suppress(OSError):  # how a terminal ends
        while part := os.read(main, 4096):
            told += part
    os.close(main)
    assert process.wait(100) == 1
    row = rb"all jobs +\d+ s +[^a-z]*0 of 1 jobs"  # name, time, bar and count
    assert re.search(row, re.sub(rb"\x1b\[[\d;]*m", b"", told)), "each column has its own words"
    assert b"started" not in told
    assert b"\x1b[?25h" in told, "the cursor is shown again"
