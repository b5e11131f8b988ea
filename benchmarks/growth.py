"""How time grows with surfels and with pixels: exponents e of time ~ n^e."""

from __future__ import annotations

from math import log

from benchmarks import workload
from benchmarks.report import Measurement, Section
from benchmarks.settings import Settings
from benchmarks.timing import Case, measure

TIMED = ("forward", "backward")


def run(settings: Settings) -> Section:
    """Time series of scenes that double in surfels or in edge, and fit a line to the logarithms.

    The surfels keep their overlap as their number grows, so that the work per pixel stays the same.
    """
    numbers, sizes = doubling(*_ends(settings.surfels)), doubling(settings.sizes[0] // 2, 2 * settings.size)
    cases = []
    for scene in settings.scenes:
        points = [("surfels", n, settings.size, n) for n in numbers]
        points += [("pixels", size * size, size, settings.n_surfels) for size in sizes]
        for axis, x, size, n in points:
            made = workload.plain(scene, size, n, settings.device)
            where = {"scene": scene, "axis": axis, "x": x, "size": size, "surfels": n}
            cases.append(Case("forward", where, {"forward": made.image}))
            cases.append(Case("forward+backward", where, made.forward_backward))
    section = Section(measure(cases, max(settings.rounds - 2, 1), settings.device, "growth"))
    for scene in settings.scenes:
        for axis in ("surfels", "pixels"):
            section.measurements += [exponent(section, scene, axis, name) for name in TIMED]
    return section


def exponent(section: Section, scene: str, axis: str, name: str) -> Measurement:
    """Least-squares slope of log time over log x, of the medians and of the minima."""
    series = [
        m
        for m in section.measurements
        if m.name == name and m.parameters["scene"] == scene and m.parameters["axis"] == axis
    ]
    x = [m.parameters["x"] for m in series]
    where = {"scene": scene, "axis": axis, "from": min(x), "to": max(x)}
    middle, best = slope(x, [m.median for m in series]), slope(x, [m.min for m in series])
    return Measurement(f"exponent of {name}", where, "1", middle, best, len(series))


def slope(x: list[float], y: list[float]) -> float:
    """Exponent e of the least-squares fit y ~ x^e."""
    s, t = [log(v) for v in x], [log(v) for v in y]
    middle, level = sum(s) / len(s), sum(t) / len(t)
    covariance = sum((a - middle) * (b - level) for a, b in zip(s, t, strict=True))
    return covariance / sum((a - middle) ** 2 for a in s)


def doubling(low: int, high: int) -> list[int]:
    """low, 2 low, 4 low, ... up to high."""
    values = [max(low, 1)]
    while 2 * values[-1] <= high:
        values.append(2 * values[-1])
    return values


def _ends(numbers: tuple[int, ...]) -> tuple[int, int]:
    """The smallest and the largest; around a single number, its half and its double."""
    return (numbers[0], numbers[-1]) if len(numbers) > 1 else (numbers[0] // 2, 2 * numbers[0])
