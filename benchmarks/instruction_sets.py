"""The library's instruction sets against each other: worker processes that take turns."""

from __future__ import annotations

import json
import subprocess
import sys
from collections import defaultdict

from benchmarks import machine, workload
from benchmarks.report import Measurement, Section
from benchmarks.settings import Settings, parse
from benchmarks.timing import visit
from texgs.raster import native

SETS = ("avx512", "avx2", "portable")


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
            if worker.stdout.readline():
                workers[name] = worker
            else:
                section.skip(f"instruction set {name}", machine.last_line(worker.stderr.read()))
        for _ in range(settings.rounds):
            for name, worker in workers.items():
                print(file=worker.stdin, flush=True)
                for quantity, seconds in json.loads(worker.stdout.readline()):
                    samples[name, quantity].append(1e3 * seconds)
    finally:
        for worker in workers.values():
            worker.terminate()
            worker.wait()
    for (name, quantity), values in samples.items():
        where = settings.where(peer=name)
        section.measurements.append(Measurement.of(quantity, where, "ms", values))
    if best := workers.keys() & {native.instruction_set()}:
        names = {quantity for _, quantity in samples}
        own = Section([m for m in section.measurements if m.parameters["peer"] in SETS])
        own.add_ratios("peer", *best, names)
        section.measurements += [m for m in own.measurements if m.unit == "ratio"]


def child() -> None:
    """Say that the library is open, then time one visit per line of standard input."""
    settings = parse(sys.argv[1:])
    made = workload.plain(settings.scene, settings.size, settings.n_surfels, settings.device)
    cases = made.cases({})
    print(json.dumps(native.instruction_set()), flush=True)
    for _ in sys.stdin:
        timings = [timed for case in cases for timed in visit(case, settings.device)]
        print(json.dumps(timings), flush=True)


def _start(name: str, settings: Settings) -> subprocess.Popen:
    size, n = str(settings.size), str(settings.n_surfels)
    words = ("--scenes", settings.scene, "--sizes", size, "--surfels", n)
    return machine.child("instruction_sets.child", *words, TEXGS_ISA=name)
