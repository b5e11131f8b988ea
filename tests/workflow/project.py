"""A copy of the project's sources that a test may edit, and Snakemake run on it."""

import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

from tests.shipped import DATASETS

ROOT = Path(__file__).parents[2]

# The smallest experiment that has all rules; its volume takes no time.
TINY = (
    "dataset.volume.generator=orbital dataset.volume.size=24 views=small views.width=40 views.height=32 "
    "views.train.frequency=1 views.test.count=3 views.relit=2 views.turntable=2 views.step=0.5 "
    "edit.text.size=64"
)

# Python runs this at its start. Else an editable installation finds texgs in the original sources.
ONLY_COPIED_SOURCES = """
import sys
sys.meta_path[:] = [finder for finder in sys.meta_path if "ScikitBuild" not in type(finder).__name__]
"""


class Project:
    """The copied sources and a working directory for results."""

    def __init__(self, folder: Path):
        self.sources, self.work = folder / "sources", folder / "work"
        self.work.mkdir(parents=True)
        for name in ("conf", "workflow", "texgs"):
            shutil.copytree(
                ROOT / name,
                self.sources / name,
                ignore=shutil.ignore_patterns("__pycache__", "libtexgs_cuda*"),
            )
        for path in (self.sources / "conf" / "dataset").iterdir():
            if path.stem not in DATASETS:  # one of the user
                path.unlink()
        shutil.copy(ROOT / "Snakefile", self.sources)
        (self.sources / "sitecustomize.py").write_text(ONLY_COPIED_SOURCES)
        self.environment = {**os.environ, "PYTHONPATH": str(self.sources)}

    def texgs(self, verb: str, *words: str) -> subprocess.CompletedProcess[str]:
        """A verb with KEY=VALUE, on the volume and views of TINY unless these say otherwise."""
        return self.typed(verb, *TINY.split(), *words)

    def typed(self, *words: str) -> subprocess.CompletedProcess[str]:
        """A verb with words and nothing else."""
        command = [sys.executable, "-P", "-m", "texgs.cli.main", *words]
        run = {"cwd": self.work, "env": self.environment, "text": True, "capture_output": True}
        return subprocess.run(command, check=False, **run)

    def start(
        self,
        *words: str,
        targets: tuple[str, ...] = ("volumes", "sheets"),
        overrides: str = "",
        config: tuple[str, ...] = ("tracking=none",),
    ) -> subprocess.Popen[str]:
        """Snakemake in a process group of its own; `targets` are rules, by default those before the fits."""
        command = [sys.executable, "-P", "-m", "snakemake", "-s", str(self.sources / "Snakefile")]
        command += ["-d", str(self.work), "--cores", "2", "--rerun-incomplete", *targets, *words]
        command += ["--config", *config, f"overrides={TINY} {overrides}"]
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
        return subprocess.Popen(command, text=True, env=self.environment, start_new_session=True, **pipes)

    def snakemake(self, *words: str, **options) -> subprocess.CompletedProcess[str]:
        """Snakemake to its end; arguments as for `start`."""
        process = self.start(*words, **options)
        try:
            out, err = process.communicate(timeout=1500)
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
        return subprocess.CompletedProcess(process.args, process.returncode, out, err)

    def planned(self, *words: str, **options) -> list[str]:
        """Jobs of a dry run, such as "views TF01"."""
        done = self.snakemake("--dry-run", *words, **options)
        assert done.returncode == 0, done.stderr + done.stdout
        jobs, rule = [], ""
        for line in done.stdout.splitlines() + done.stderr.splitlines():
            word, _, rest = line.strip().partition(" ")
            if word in ("rule", "localrule"):
                rule = rest.rstrip(":")
            elif word == "wildcards:":
                jobs.append(
                    f"{rule} {dict(pair.split('=') for pair in rest.split(', ')).get('tf', '')}".strip()
                )
        return sorted(jobs)

    def edit(self, name: str, old: str, new: str) -> None:
        path = self.sources / name
        text = path.read_text()
        assert old in text, f"{old} is not in {name}"
        path.write_text(text.replace(old, new, 1))
