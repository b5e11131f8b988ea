"""How busy the machine was with other things while something was measured."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import Any

COUNTERS = Path("/proc/stat")
NOISY = 0.1  # processors: a thread that waits its turn holds up all others at the next barrier


@dataclass
class Load:
    """Load averages before and after a block of code (which adds to the second), and what others took."""

    average_before: list[float] | None = field(default_factory=lambda: average())
    average_after: list[float] | None = None
    seconds: float = 0.0
    processors_of_others: float | None = None  # that they kept busy on average

    def __enter__(self) -> Load:
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
