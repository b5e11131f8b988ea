"""One table as CSV and Markdown; each row knows the jobs that its numbers are from."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

Cell = str | float | int | None
MISSING = "not measured"
SOURCES = "metrics files"  # heading in CSV
UNPUBLISHED = "-"  # in columns of the paper's numbers: it has none
UNLIKE = "≠"  # there: it has one, of something else


@dataclass(frozen=True)
class Column:
    """One column: its heading and how its numbers are written."""

    title: str
    digits: int | None = None  # after the point; None: as they are
    missing: str = MISSING  # in place of a cell that is None

    def text(self, cell: Cell) -> str:
        """A cell as people read it."""
        if cell is None:
            return self.missing
        if isinstance(cell, str) or self.digits is None:
            return str(cell)
        return f"{cell:,.{self.digits}f}"


@dataclass(frozen=True)
class Row:
    """One row: its cells, and the metrics files that they were read from."""

    cells: Sequence[Cell]
    sources: Sequence[Path]


@dataclass(frozen=True)
class Table:
    """Rows of cells; what was not measured says so."""

    caption: str
    columns: Sequence[Column]
    rows: Sequence[Row]
    heading: str = ""

    def texts(self) -> list[list[str]]:
        """All cells as people read them."""
        return [
            [column.text(cell) for column, cell in zip(self.columns, row.cells, strict=True)]
            for row in self.rows
        ]

    def csv(self) -> str:
        """Comma separated, numbers in full, sources last; an empty cell has no number of its own."""
        file = io.StringIO()
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([*(column.title for column in self.columns), SOURCES])
        for row in self.rows:
            sources = " ".join(path.as_posix() for path in row.sources)
            writer.writerow(["" if cell in (None, UNLIKE) else cell for cell in (*row.cells, sources)])
        return file.getvalue()

    def markdown(self) -> str:
        """A Markdown table, numbers to the right."""
        rule = ["---" if column.digits is None else "---:" for column in self.columns]
        lines = [[column.title for column in self.columns], rule, *self.texts()]
        rows = [" | ".join(one_line(text).replace("|", r"\|") for text in line) for line in lines]
        parts = [f"## {self.heading}"] if self.heading else []
        parts += ["\n".join(f"| {row} |" for row in rows), one_line(self.caption)]
        return "\n\n".join(parts) + "\n"


def one_line(text: str) -> str:
    """Text without line breaks, which end a row of a table."""
    return " ".join(text.split())
