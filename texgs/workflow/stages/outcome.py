"""What a stage hands to whoever ran it."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from texgs.report.results import Result


@dataclass(frozen=True)
class Outcome:
    """A result for metrics.json, and pictures for the report and the tracked run."""

    result: Result
    pictures: Mapping[str, str] = field(default_factory=dict)  # what files of the output show, by their names
