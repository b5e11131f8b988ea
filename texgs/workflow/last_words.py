"""What failed jobs have said last, told once more below all that Snakemake prints about them."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path

INTERRUPTED = ": interrupted; "  # of `texgs.cli.main`: the end of a run says so by itself


def tell(logs: Iterable[Path]) -> None:
    """Print the last line of each log on stderr, but of jobs that were interrupted; the same one once."""
    for line in dict.fromkeys(filter(None, map(last_line, logs))):
        print(line, file=sys.stderr)


def last_line(log: Path) -> str:
    """The last line with text of a log; empty where there is none, or the job was interrupted."""
    try:
        lines = log.read_text(encoding="utf-8", errors="replace").split("\n")
    except OSError:
        return ""
    line = next((line for line in reversed(lines) if line.strip()), "")
    return "" if INTERRUPTED in line else line
