"""The metrics files of jobs, read and checked."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from importlib.resources import files
from pathlib import Path
from typing import Any

from texgs.config.fields import kinds
from texgs.core.errors import ArgumentError
from texgs.core.io import read_json


def read(paths: Iterable[str | Path]) -> list[tuple[Path, dict[str, Any]]]:
    """All metrics, in the order of their paths.

    Raises:
        ArgumentError: if a file is no metrics file.
    """
    found = []
    for path in sorted(map(Path, paths)):
        metrics = read_json(path)
        if not isinstance(metrics, dict) or "numbers" not in metrics:
            raise ArgumentError(f"{path}: expected the metrics of a job, got something else")
        found.append((path, metrics))
    return found


def below(folder: str | Path) -> list[Path]:
    """The metrics files of all results in a folder, without those of jobs that are still at work."""
    paths = Path(folder).rglob("metrics.json")
    return sorted(path for path in paths if not any(part.startswith(".") for part in path.parts))


def phases() -> list[str]:
    """The phases of all kinds of fields, in their order."""
    return [phase for kind in kinds().values() for phase in kind.phases]


def fits(paths: Iterable[str | Path]) -> list[tuple[Path, dict[str, Any]]]:
    """The metrics of the phases of fits; see `read`."""
    return [(path, metrics) for path, metrics in read(paths) if metrics["stage"] in phases()]


def paper(name: str, keys: int = 1) -> dict[tuple[str, ...], dict[str, str]]:
    """The paper's numbers of a table, by the values of its first columns; none for other tables."""
    file = files("texgs.report").joinpath("paper", f"{name}.csv")
    if not file.is_file():
        return {}
    lines = [line for line in file.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    return {tuple(list(row.values())[:keys]): row for row in csv.DictReader(lines)}
