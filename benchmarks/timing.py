"""Timing cases round-robin, so that the noise of a shared machine falls on all of them alike."""

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import torch
from tqdm import tqdm

from benchmarks.report import Measurement
from texgs.raster import native

WARM_RUNS = 2  # not timed: after them caches and threads are as in a training loop
RUNS = 3  # timed, in a row
WARM_SECONDS, VISIT_SECONDS = 0.2, 1.0  # slow cases run fewer times in a row


@dataclass
class Case:
    """Something to time: phases that follow one another, each on its own and all together."""

    name: str  # of the sum of the phases
    parameters: dict[str, Any]
    phases: dict[str, Callable[[], object]]
    threads: int | None = None  # None: as many as torch is set to
    has_passes: bool = False  # time the CPU library's passes as well


def measure(cases: Sequence[Case], rounds: int, device: torch.device, title: str) -> list[Measurement]:
    """Visit all cases `rounds` times; medians and minima in milliseconds."""
    samples: dict[tuple[int, str], list[float]] = defaultdict(list)
    with tqdm(total=rounds * len(cases), desc=title, leave=False) as progress:
        for _ in range(rounds):
            for index, case in enumerate(cases):
                for name, seconds in visit(case, device):
                    samples[index, name].append(1e3 * seconds)
                progress.update()
    return [
        Measurement.of(name, cases[index].parameters, "ms", values)
        for (index, name), values in samples.items()
    ]


def visit(case: Case, device: torch.device) -> Iterator[tuple[str, float]]:
    """Names and seconds of up to RUNS runs."""
    with threads(case.threads):
        begin = perf_counter()
        for _ in range(WARM_RUNS):
            run_once(case, device)
            if perf_counter() - begin > WARM_SECONDS:
                break
        begin = perf_counter()
        for _ in range(RUNS):
            yield from run_once(case, device).items()
            if perf_counter() - begin > VISIT_SECONDS:
                break


def run_once(case: Case, device: torch.device) -> dict[str, float]:
    """Seconds of one run by name: phases, their sum, passes."""
    times = {name: seconds(phase, device) for name, phase in case.phases.items()}
    times = {case.name: sum(times.values())} | times
    if case.has_passes:
        times |= {f"pass {name}": taken for name, taken in native.pass_seconds().items()}
    return times


def seconds(run: Callable[[], object], device: torch.device) -> float:
    """Seconds that a function takes; on a GPU, until its work is done there."""
    if device.type != "cuda":
        begin = perf_counter()
        run()
        return perf_counter() - begin
    start, end = (torch.cuda.Event(enable_timing=True) for _ in range(2))
    torch.cuda.synchronize(device)
    start.record()
    run()
    end.record()
    end.synchronize()
    return 1e-3 * start.elapsed_time(end)


@contextmanager
def threads(n: int | None) -> Iterator[None]:
    """Let torch, and the library with it, use n threads."""
    before = torch.get_num_threads()
    torch.set_num_threads(n or before)
    try:
        yield
    finally:
        torch.set_num_threads(before)
