"""The library's instruction sets against each other: worker processes that take turns."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections import defaultdict
from pathlib import Path

from benchmarks import machine, workload
from benchmarks.report import Measurement, Section
from benchmarks.settings import Settings, parse
from benchmarks.timing import Case, visit
from texgs.raster import native

ROOT = Path(__file__).parents[1]
SETS = ("avx512", "avx2", "portable")
CHILD = "from benchmarks.instruction_sets import child; child()"


def compare(settings: Settings, section: Section) -> None:
    """Time forward and forward + backward with each, and as ratios to the best.

    TEXGS_ISA is read as the library is opened: each set has a process, which times one visit per line that it
    is sent and sleeps in between.
    """
    workers = {}
    samples: dict[tuple[str, str], list[float]] = defaultdict(list)
    try:
        for name in SETS:
            worker = _start(name, settings)
            if problem := _problem(worker):
                section.skip(f"instruction set {name}", problem)
            else:
                workers[name] = worker
        for _ in range(settings.rounds):
            for name, worker in workers.items():
                print(file=worker.stdin, flush=True)
                for quantity, seconds in json.loads(worker.stdout.readline()):
                    samples[name, quantity].append(1e3 * seconds)
    finally:
        for worker in workers.values():
            worker.terminate()
            worker.wait()
    _report(settings, section, samples)


def _report(settings: Settings, section: Section, samples: dict[tuple[str, str], list[float]]) -> None:
    for (name, quantity), values in samples.items():
        where = settings.where(peer=name)
        section.measurements.append(Measurement.of(quantity, where, "ms", values))
    best = native.instruction_set()
    for m in [m for m in section.measurements if m.parameters["peer"] in SETS]:
        if m.parameters["peer"] != best and (best, m.name) in samples:
            section.measurements.append(m.over(section.find(m.name, peer=best), f"{m.name} / {best}"))


def child() -> None:
    """Say that the library is open, then time one visit per line of standard input."""
    settings = parse(sys.argv[1:])
    made = workload.plain(settings.scene, settings.size, settings.n_surfels, settings.device)
    cases = [
        Case("forward", {}, {"forward": made.image}),
        Case("forward+backward", {}, made.forward_backward),
    ]
    print(json.dumps(native.instruction_set()), flush=True)
    for _ in sys.stdin:
        timings = [timed for case in cases for timed in visit(case, settings.device)]
        print(json.dumps(timings), flush=True)


def _start(name: str, settings: Settings) -> subprocess.Popen:
    arguments = [
        "--scenes",
        settings.scene,
        "--sizes",
        str(settings.size),
        "--surfels",
        str(settings.n_surfels),
    ]
    return subprocess.Popen(
        [sys.executable, "-c", CHILD, *arguments],
        cwd=ROOT,
        env={**os.environ, "TEXGS_ISA": name},
        preexec_fn=machine.unbind,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def _problem(worker: subprocess.Popen) -> str:
    """Why the worker did not open the library, "" if it did."""
    if worker.stdout.readline():
        return ""
    return (worker.stderr.read().strip().splitlines() or ["it died"])[-1]
