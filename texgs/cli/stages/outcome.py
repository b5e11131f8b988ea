"""What a stage hands to whoever ran it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Outcome:
    """Numbers for metrics.json, and pictures for the report and the tracked run."""

    numbers: dict[str, Any]  # values that JSON knows; units in the names (`_ms`, `_mib`)
    pictures: Mapping[str, str] = field(default_factory=dict)  # what files of the output show, by their names
