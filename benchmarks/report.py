"""What the sections return: measurements, their ratios, and what could not be measured."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from statistics import median
from typing import Any


@dataclass(frozen=True)
class Measurement:
    """One quantity under one set of parameters."""

    name: str
    parameters: dict[str, Any]
    unit: str  # ms, MB, ratio or 1
    median: float
    min: float
    n: int

    @classmethod
    def of(cls, name: str, parameters: dict[str, Any], unit: str, values: Iterable[float]) -> Measurement:
        """Median and minimum of the values."""
        samples = list(values)
        return cls(name, parameters, unit, median(samples), min(samples), len(samples))

    def over(self, other: Measurement, name: str, **more: Any) -> Measurement:
        """How many times as much as another one; medians by medians, minima by minima."""
        return Measurement(
            name,
            self.parameters | more,
            "ratio",
            self.median / other.median,
            self.min / other.min,
            min(self.n, other.n),
        )


@dataclass
class Section:
    """The measurements of one part of the benchmark."""

    measurements: list[Measurement] = field(default_factory=list)
    skipped: list[dict[str, str]] = field(default_factory=list)  # name and reason

    def skip(self, name: str, reason: str) -> None:
        """Note why something was not measured."""
        self.skipped.append({"name": name, "reason": reason})

    def find(self, name: str, **parameters: Any) -> Measurement:
        """The measurement of that name whose parameters include these."""
        (measurement,) = (
            m for m in self.measurements if m.name == name and parameters.items() <= m.parameters.items()
        )
        return measurement
