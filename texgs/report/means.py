"""Means of what has several basic scenes, seeds or data sets."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from statistics import fmean

from texgs.report.table import Cell, Row


def mean(values: Iterable[float | None]) -> float | None:
    """The mean; None where a value is missing, or there is none."""
    listed = list(values)
    known = [value for value in listed if value is not None]
    return fmean(known) if known and len(known) == len(listed) else None


def mean_rows(rows: Sequence[Row], keys: int) -> list[Row]:
    """A row for each group of two rows or more that agree in their first columns but the data set.

    A column of numbers has their mean where all rows have one; words stay where they are the same in all.

    Args:
        rows: of data sets that count.
        keys: how many columns, the data set included, tell groups apart.
    """
    groups: dict[tuple[Cell, ...], list[Row]] = defaultdict(list)
    for row in rows:
        groups[tuple(row.cells[1:keys])].append(row)
    return [
        Row(
            [f"mean of {len(group)}", *key, *means(group, keys)],
            [path for row in group for path in row.sources],
        )
        for key, group in groups.items()
        if len(group) > 1
    ]


def means(rows: Sequence[Row], first: int) -> list[Cell]:
    """The cells of a mean row from a column on."""
    cells: list[Cell] = []
    for column in list(zip(*(row.cells for row in rows), strict=True))[first:]:
        numbers = [cell for cell in column if isinstance(cell, int | float)]
        same = column[0] if len(set(column)) == 1 else None
        cells.append(mean(numbers) if len(numbers) == len(column) else same)
    return cells
