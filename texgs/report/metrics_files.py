"""The metrics files of jobs, read and checked."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from texgs.core.errors import ArgumentError
from texgs.core.io import read_json

PHASES = ("surfels", "shading", "texture")


def fits(paths: Iterable[str | Path]) -> list[tuple[Path, dict[str, Any]]]:
    """The metrics of the phases of fits, by path.

    Raises:
        ArgumentError: if a file is no metrics file.
    """
    found = []
    for path in sorted(map(Path, paths)):
        metrics = read_json(path)
        if not isinstance(metrics, dict) or "numbers" not in metrics:
            raise ArgumentError(f"{path}: expected the metrics of a job, got something else")
        if metrics["stage"] in PHASES:
            found.append((path, metrics))
    return found
