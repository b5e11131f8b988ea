"""Kill the demo again and again at random moments, then let it end, and compare it with an undisturbed run.

python tools/kill_runs.py FOLDER --kills 100 [KEY=VALUE ...]

Half of the kills end the whole process group at any moment, the other half end one while a tracked job runs.
Files, numbers and models have to be equal; no run may be left RUNNING, no folder of work behind, and nothing
is unlocked by hand. Times, tables of times and numbers of runs are not compared.
"""

import argparse
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
from compare_results import contents, different


def start(folder: Path, words: list[str]) -> subprocess.Popen[str]:
    """The workflow in a process group of its own, with its output in log.txt."""
    folder.mkdir(parents=True, exist_ok=True)
    command = [sys.executable, "-m", "texgs.cli.main", "run", "experiment=demo", *words]
    with (folder / "log.txt").open("a") as log:
        return subprocess.Popen(
            command, cwd=folder, stdout=log, stderr=subprocess.STDOUT, text=True, start_new_session=True
        )


def has_job(process: subprocess.Popen[str]) -> bool:
    """Whether a stage runs below the workflow."""
    try:
        children = psutil.Process(process.pid).children(recursive=True)
        return any("--settings" in child.cmdline() for child in children)
    except psutil.Error:
        return False


def kill(folder: Path, words: list[str], chance: random.Random, inside_job: bool) -> bool:
    """Start the workflow and kill it; whether it was still running then."""
    process = start(folder, words)
    deadline = time.monotonic() + 120
    while inside_job and not has_job(process) and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.02)
    longest = 4 if inside_job else 20
    ends = time.monotonic() + chance.uniform(0, longest)
    while process.poll() is None and time.monotonic() < ends:
        time.sleep(0.01)
    was_running = process.poll() is None
    if was_running:
        os.killpg(process.pid, chance.choice((signal.SIGKILL, signal.SIGKILL, signal.SIGTERM)))
    process.wait()
    return was_running


def statuses(results: Path) -> dict[str, int]:
    """How many tracked runs have which status."""
    from mlflow import MlflowClient

    client = MlflowClient(f"sqlite:///{results.absolute()}/mlflow.db")
    experiments = [each.experiment_id for each in client.search_experiments()]
    counts: dict[str, int] = {}
    for run in client.search_runs(experiments, max_results=10000):
        counts[run.info.status] = counts.get(run.info.status, 0) + 1
    return counts


def main() -> int:
    """Run both, compare, and say what differs; 1 if anything does."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("words", nargs="*", metavar="KEY=VALUE")
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_intermixed_args()
    chance, done = random.Random(arguments.seed), [0, 0]
    killed, undisturbed = arguments.folder / "killed", arguments.folder / "undisturbed"
    while sum(done) < arguments.kills:
        inside_job = done[1] <= done[0]
        if kill(killed, arguments.words, chance, inside_job):
            done[inside_job] += 1
            print(f"{sum(done)} kills", end="\r", flush=True)
        else:  # it had ended: begin again with something to do
            (killed / "results" / "orbital" / "volume" / "volume.nrrd").unlink(missing_ok=True)
    codes = [start(folder, arguments.words).wait() for folder in (killed, undisturbed)]
    names = different(killed / "results", undisturbed / "results")
    left = [str(path) for path in (killed / "results").rglob(".*") if path.suffix in (".work", ".old")]
    counts = statuses(killed / "results")
    print(f"{done[0]} kills at any moment, {done[1]} inside a job; exit codes {codes}")
    print(f"{len(contents(undisturbed / 'results'))} files compared, different: {names}; left behind: {left}")
    print(f"runs: {counts}")
    return int(bool(names or left or any(codes) or "RUNNING" in counts))


if __name__ == "__main__":
    sys.exit(main())
