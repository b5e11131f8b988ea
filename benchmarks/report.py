"""What the sections return: measurements, their ratios, what could not be measured; and tables of these."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from statistics import median
from typing import Any, Self

import pandas as pd


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
    def of(cls, name: str, parameters: dict[str, Any], unit: str, values: Iterable[float]) -> Self:
        """Return the median and minimum of the values."""
        samples = list(values)
        return cls(name, parameters, unit, median(samples), min(samples), len(samples))

    def over(self, other: Self, name: str, **more: Any) -> Self:
        """Return how many times as much it is as another one; medians by medians, minima by minima."""
        ratios = self.median / other.median, self.min / other.min
        return type(self)(name, self.parameters | more, "ratio", *ratios, min(self.n, other.n))


@dataclass
class Section:
    """The measurements of one part of the benchmark."""

    measurements: list[Measurement] = field(default_factory=list)
    skipped: list[dict[str, str]] = field(default_factory=list)  # name and reason

    def skip(self, name: str, reason: str) -> None:
        """Note why something was not measured."""
        self.skipped.append({"name": name, "reason": reason})

    def find(self, name: str, **parameters: Any) -> Measurement:
        """Return the measurement of that name whose parameters include these."""
        (measurement,) = (
            m for m in self.measurements if m.name == name and parameters.items() <= m.parameters.items()
        )
        return measurement

    def add_ratios(self, key: str, reference: str, names: Iterable[str], label: str = "{}") -> None:
        """Add what the others take over the one whose parameter `key` is the reference."""
        others = [m for m in self.measurements if m.name in names and m.parameters[key] != reference]
        for m in others:
            other = self.find(m.name, **m.parameters | {key: reference})
            self.measurements.append(m.over(other, f"{label.format(m.name)} / {reference}"))


def show(title: str, section: Section) -> None:
    """Print a section: times, passes, ratios and the like apart, then what was skipped."""
    groups: dict[tuple, list[Measurement]] = {}
    for m in section.measurements:
        kind = "ms, passes" if m.name.startswith("pass ") else m.unit
        groups.setdefault((kind, tuple(m.parameters)), []).append(m)
    for (kind, _), measurements in groups.items():
        print(f"\n{title} [{kind}]: median (minimum)")
        print_table(measurements)
    for skipped in section.skipped:
        print(f"\n{title}: {skipped['name']} skipped: {skipped['reason']}")


def print_table(measurements: list[Measurement]) -> None:
    """Print a row for each set of parameters, a column for each quantity."""
    rows = [m.parameters | {m.name.removeprefix("pass "): cell(m)} for m in measurements]
    table = pd.DataFrame(rows).groupby(list(measurements[0].parameters), sort=False).first()
    print(table.reset_index().to_string(index=False, na_rep=""))


def cell(m: Measurement) -> str:
    """Return the median and, if there is more than one value, the minimum; four digits at most."""
    return number(m.median) if m.n == 1 else f"{number(m.median)} ({number(m.min)})"


def number(value: float) -> str:
    """Return three significant digits without an exponent, unless the value is tiny."""
    if value and abs(value) < 1e-3:
        return f"{value:.1e}"
    digits = 0 if abs(value) >= 100 else 1 if abs(value) >= 10 else 2
    return f"{value:.{digits}f}"
