"""What a stage hands to whoever ran it."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Outcome:
    """Numbers for metrics.json, and files that are worth a place in the tracked run."""

    numbers: dict[str, Any]  # values that JSON knows; units in the names (`_ms`, `_mib`)
    pictures: list[Path] = field(default_factory=list)
