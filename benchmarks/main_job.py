"""The whole way from a volume to edited scenes, tables and report: seconds of `texgs run`, by stage.

`python -m benchmarks.main_job OUTPUT.json DATASET,DATASET... KEY=VALUE...` runs each data set in a folder of
its own, where nothing is done yet; words with = are overrides for all of them. What the jobs do not account
for is the plan, starts of jobs, and waiting.
"""

import json
import subprocess
import sys
import tempfile
from collections import defaultdict
from dataclasses import asdict
from pathlib import Path
from time import perf_counter, sleep
from typing import Any

import torch

from benchmarks import machine
from benchmarks.command import call
from texgs.report.metrics_files import below

WORDS = ("fit=quick", "views.width=400", "views.height=400")
EDITS = "edits=[glass,gold]"


def main(output: str, names: str, *overrides: str) -> None:
    """Run the data sets one after the other; print and write what each took."""
    words = (*WORDS, EDITS, *overrides)
    runs = {name: seconds_of(f"dataset={name}", *words) for name in names.split(",")}
    described = machine.describe(torch.device("cpu"))
    Path(output).write_text(json.dumps({"machine": described, "words": words, "runs": runs}, indent=1) + "\n")


def seconds_of(*words: str) -> dict[str, Any]:
    """Run a fresh project to its report."""
    with tempfile.TemporaryDirectory() as folder:
        with machine.Load() as load:  # before the run, whose jobs are no children of this process
            sleep(5)
        start = perf_counter()
        program = Path(sys.executable).with_name("texgs")
        subprocess.run([program, "run", *words, "--directory", folder], check=True)
        whole = perf_counter() - start
        files = below(Path(folder, "results"))
        stages: dict[str, float] = defaultdict(float)
        for file in files:  # of all stages, whose results are in their modules: only two facts are read
            facts = json.loads(file.read_text(encoding="utf-8"))
            stages[facts["stage"]] += facts["seconds"]
    by_stage = {name: round(s, 2) for name, s in sorted(stages.items(), key=lambda item: -item[1])}
    print(*words, f"took {whole:.0f} s, jobs {sum(stages.values()):.0f} s of these:", by_stage)
    return {"seconds": round(whole, 1), "jobs": len(files), "stages": by_stage, "load before": asdict(load)}


if __name__ == "__main__":
    call(main, "benchmarks.main_job volume views surfels shading texture compose image text edit_metrics")
