"""Measurements as tables on the screen: a row for each set of parameters, a column for each quantity."""

from __future__ import annotations

from benchmarks.report import Measurement, Section


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
    """Pivot measurements with the same names of parameters."""
    names = list(dict.fromkeys(m.name for m in measurements))
    rows: dict[tuple, dict[str, str]] = {}
    for m in measurements:
        rows.setdefault(tuple(m.parameters.values()), {})[m.name] = cell(m)
    header = [*measurements[0].parameters, *(name.removeprefix("pass ") for name in names)]
    lines = [header]
    lines += [[*map(str, row), *(cells.get(name, "") for name in names)] for row, cells in rows.items()]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    for line in lines:
        print("  ".join(text.rjust(width) for text, width in zip(line, widths, strict=True)))


def cell(m: Measurement) -> str:
    """Median and, if there is more than one value, minimum; four digits at most."""
    return number(m.median) if m.n == 1 else f"{number(m.median)} ({number(m.min)})"


def number(value: float) -> str:
    """Three significant digits without an exponent, unless the value is tiny."""
    if value and abs(value) < 1e-3:
        return f"{value:.1e}"
    digits = 0 if abs(value) >= 100 else 1 if abs(value) >= 10 else 2
    return f"{value:.{digits}f}"
