"""The steps of a series in time: which files they come from, and in which order."""

import re
from collections.abc import Iterable, Sequence
from fractions import Fraction
from glob import escape, glob
from itertools import pairwise
from os.path import commonpath
from pathlib import Path
from typing import NamedTuple

from texgs.core.errors import ArgumentError
from texgs.core.names import natural_order

FORMAT = re.compile(r"\.[A-Za-z]\w*$")  # not the .5 of a folder t_0.5
NUMBER = re.compile(r"(\d+)(?:\.(\d+))?(?=\D*$)")


class Moment(NamedTuple):
    """Where the volume of a step comes from: a file or folder, a step along its time, or a generator."""

    name: str  # of the step
    file: Path | None = None
    time: int | None = None


def matching(patterns: Iterable[str | Path]) -> list[Path]:
    """Return what paths with wildcards stand for, files or folders; each has to stand for some.

    What several of them stand for is there once. A path that is there stands for itself, and a folder that is
    there is no pattern, whatever is in its name.
    """
    files = []
    for pattern in map(str, patterns):
        folder = pattern.rstrip("/").rpartition("/")[0]
        known = escape(folder) if Path(folder).exists() else folder
        found = [pattern] if Path(pattern).exists() else glob(known + pattern[len(folder) :])  # noqa: PTH207 - Path's takes no whole path
        matches = sorted(map(Path, found), key=natural_order)
        if not matches:
            raise ArgumentError(f"expected files that are there, got {pattern}")
        files += matches
    return list(dict.fromkeys(files))


def in_time(files: Sequence[Path]) -> list[Moment]:
    """Return the steps of several files, in the order of their numbers where all have one.

    Numbers that are multiples of their least distance count steps, of which none may be missing; others are
    dates, say. Numbers may have decimals, as in t_0.5.
    """
    if len(files) < 2:
        got = ", ".join(map(str, files)) or "none"
        raise ArgumentError(f"expected two files at least, got {got}; 'step_*.nrrd' names several")
    paths = [file.absolute() for file in files]
    base = Path(commonpath([path.parent for path in paths]))
    is_root = base == Path(base.anchor)  # a name without its slash would be that of another file
    names = [(path if is_root else path.relative_to(base)).as_posix() for path in paths]
    moments = [Moment(name, file) for name, file in zip(names, files, strict=True)]
    has_decimals = are_decimal(names)
    numbers = {name: number_of(name, has_decimals) for name in names}
    if None in numbers.values():
        return moments
    moments.sort(key=lambda moment: natural_order(Path(moment.name), has_decimals=has_decimals))
    gaps = [(numbers[after.name] or 0) - (numbers[before.name] or 0) for before, after in pairwise(moments)]
    least = min(gaps)
    is_count = least > 0 and all(gap % least == 0 for gap in gaps)
    for (before, after), gap in zip(pairwise(moments), gaps, strict=True):
        if is_count and gap > least:
            raise ArgumentError(
                f"expected a file each {float(least):g}, got none between {before.name} and {after.name}; "
                "name the files of one part of the series"
            )
    return moments


def are_decimal(names: Iterable[str]) -> bool:
    """Return whether the last numbers in names are decimals: some differ in digits behind a point.

    Where some of these end with 0, as in 3.10, they count: nobody writes a decimal so.
    """
    found = [NUMBER.search(FORMAT.sub("", name)) for name in names]
    fractions = {number[2] or "" for number in found if number}
    return len({*map(len, fractions)}) > 1 and not any(len(x) > 1 and x.endswith("0") for x in fractions)


def number_of(name: str, has_decimals: bool) -> Fraction | None:
    """Return the last number in the name of a step, without its suffix."""
    number = NUMBER.search(FORMAT.sub("", name))
    if number is None:
        return None
    whole, decimals = number.groups()
    return Fraction(f"{whole}.{decimals or 0}" if has_decimals else decimals or whole)
