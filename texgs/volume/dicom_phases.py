"""Series of one DICOM folder that are steps in time, as 4D CT is exported: one for each phase."""

import re
from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

from texgs.core.errors import ArgumentError

ALL = "all"  # in place of the number of a series
# What orders series, and how it stands in them: the first counts that is not the same in all.
ORDERS = {
    "temporal position": ("position", r"^(-?\d+)$"),
    "percentage": ("description", r"(\d+(?:\.\d+)?) ?%"),
    "series number": ("number", r"^(-?\d+)$"),
}


class FileSeries(NamedTuple):
    """A series in a folder, as its first file tells."""

    files: Sequence[str]
    uid: str = ""
    number: str = ""
    description: str = ""
    position: str = ""  # in time
    lattice: tuple[float, ...] = ()  # number of slices, and all that the first says of it; empty: it has none

    def __str__(self) -> str:
        return f"{self.number} ({self.description}, {len(self.files)} files, UID {self.uid})"


def phases_of(every: Sequence[FileSeries]) -> tuple[list[FileSeries], str]:
    """Return the series on the lattice that most have, in the order of time, and a sentence on them."""
    ranked = Counter(each.lattice for each in every if each.lattice).most_common(2)
    (lattice, count), (_, next_count), *_ = [*ranked, ((), 0), ((), 0)]
    if count < 2 or count == next_count:
        got = "; ".join(map(str, every))
        raise ArgumentError(f"expected series on one lattice, more than on any other, got {got}")
    phases, left = ([each for each in every if (each.lattice == lattice) is x] for x in (True, False))
    if part := next((each for each in left if each.lattice[1:] == lattice[1:]), None):
        raise ArgumentError(f"expected series as long as {phases[0]}, got {part}; complete them")
    phases, name = in_order(phases)
    words = f"steps are the {count} series {phases[0].number} to {phases[-1].number}, ordered by {name}"
    return phases, words + (f"; left out, on other lattices: {'; '.join(map(str, left))}" if left else "")


def in_order(phases: Sequence[FileSeries]) -> tuple[list[FileSeries], str]:
    """Return series in the order of time, and what tells it."""
    for name, (field, pattern) in ORDERS.items():
        matches = [re.search(pattern, getattr(each, field)) for each in phases]
        numbers = {each: float(match[1]) for each, match in zip(phases, matches, strict=True) if match}
        if len({*numbers.values()}) == len(phases):
            return sorted(phases, key=numbers.__getitem__), name
        if len({*map(numbers.get, phases)}) > 1:
            break
    raise ArgumentError(f"expected a {name} in each series, all different, got {'; '.join(map(str, phases))}")
