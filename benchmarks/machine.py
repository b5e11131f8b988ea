"""What the figures were measured on, and how busy it was with other things meanwhile."""

import os
import platform
import subprocess
import sys
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from time import perf_counter
from typing import Any, Self

import torch

import texgs
from texgs.raster import native

ROOT = Path(__file__).parents[1]
COUNTERS = Path("/proc/stat")
NOISY = 0.1  # processors: a thread that waits its turn holds up all others at the next barrier


def describe(device: torch.device) -> dict:
    """Processor, versions and date; how busy it was comes with the sections."""
    return {
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "processor": processor(),
        "processors": os.cpu_count(),
        "threads_bound": os.environ.get("OMP_PROC_BIND", "no"),
        "device": torch.cuda.get_device_name(device) if device.type == "cuda" else "cpu",
        "instruction_set": native.instruction_set(device.type),
        "threads": torch.get_num_threads(),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "torch": torch.__version__,
        "texgs": texgs.__version__,
        "revision": revision(),
    }


def unbind() -> None:
    """Let a process run on every processor: OMP_PROC_BIND ties its parent's main thread to one."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, range(os.cpu_count() or 1))


def child(function: str, *words: str, **environment: str) -> subprocess.Popen:
    """Start a function of the benchmarks, MODULE.NAME, in a process of its own on every processor."""
    module, _, name = function.partition(".")
    code = f"from benchmarks.{module} import {name}; {name}()"
    pipes = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE)
    words = (sys.executable, "-c", code, *words)
    variables = {**os.environ, **environment}
    return subprocess.Popen(words, cwd=ROOT, env=variables, preexec_fn=unbind, text=True, **pipes)


def last_line(text: str) -> str:
    """Return what a process said last, which is why it ended."""
    return (text.strip().splitlines() or ["it died"])[-1]


def processor() -> str:
    """The processor's name as the system tells it."""
    listing = Path("/proc/cpuinfo")
    lines = listing.read_text().splitlines() if listing.exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or "unknown"


def revision() -> str:
    """The commit of the source tree, with "-dirty" if it was changed."""
    command = ["git", "describe", "--always", "--dirty"]
    try:
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    except OSError:
        return "unknown"
    return done.stdout.strip() or "unknown"


@dataclass
class Load:
    """Load averages before and after a block of code (which adds to the second), and what others took."""

    average_before: list[float] | None = field(default_factory=lambda: average())
    average_after: list[float] | None = None
    seconds: float = 0.0
    processors_of_others: float | None = None  # that they kept busy on average

    def __enter__(self) -> Self:
        self._start = (perf_counter(), others())
        return self

    def __exit__(self, *_: Any) -> None:
        begin, before = self._start
        self.seconds = round(perf_counter() - begin, 2)
        if before is not None and self.seconds:
            self.processors_of_others = round(max(others() - before, 0.0) / self.seconds, 3)
        self.average_after = average()

    def __str__(self) -> str:
        text = f"{self.seconds} s, load average {self.average_before} before, {self.average_after} after"
        if self.processors_of_others is None:
            return text
        text += f", others kept {self.processors_of_others} processors busy"
        return text if self.processors_of_others < NOISY else f"{text}: trust minima rather than medians"


def average() -> list[float] | None:
    """Runnable processes of the last 1, 5 and 15 minutes; None where the system does not tell."""
    return [round(x, 2) for x in os.getloadavg()] if hasattr(os, "getloadavg") else None


def others() -> float | None:
    """Processor seconds that went to anything but this process and its finished children, so far.

    What a hypervisor took away counts, too. None where the system does not tell.
    """
    if not COUNTERS.exists():
        return None
    ticks = [int(word) for word in COUNTERS.read_text().split("\n", 1)[0].split()[1:9]]
    idle = ticks[3] + ticks[4]  # waiting for a disk is idle as well
    return (sum(ticks) - idle) / os.sysconf("SC_CLK_TCK") - sum(os.times()[:4])
