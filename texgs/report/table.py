"""One table in three formats: CSV, Markdown and LaTeX; each row knows the jobs that its numbers are from."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from texgs.core.io import write_bytes

Cell = str | float | int | None
MISSING = "not measured"
SOURCES = "metrics files"  # heading in CSV
UNPUBLISHED = "-"  # in columns of the paper's numbers


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
        return f"{cell:.{self.digits}f}"


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

    def texts(self) -> list[list[str]]:
        """All cells as people read them."""
        return [
            [column.text(cell) for column, cell in zip(self.columns, row.cells, strict=True)]
            for row in self.rows
        ]

    def csv(self) -> str:
        """Comma separated, numbers in full, sources last; an empty cell is not measured."""
        file = io.StringIO()
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([*(column.title for column in self.columns), SOURCES])
        for row in self.rows:
            sources = " ".join(path.as_posix() for path in row.sources)
            writer.writerow(["" if cell is None else cell for cell in (*row.cells, sources)])
        return file.getvalue()

    def markdown(self) -> str:
        """A Markdown table, numbers to the right."""
        rule = ["---" if column.digits is None else "---:" for column in self.columns]
        lines = [[column.title for column in self.columns], rule, *self.texts()]
        return "\n".join(f"| {' | '.join(line)} |" for line in lines) + f"\n\n{self.caption}\n"

    def latex(self) -> str:
        """A LaTeX tabular between rules of booktabs."""
        kinds = "".join("l" if column.digits is None else "r" for column in self.columns)
        lines = [[column.title for column in self.columns], *self.texts()]
        head, *body = (" & ".join(map(escape, line)) + r" \\" for line in lines)
        rows = [rf"\begin{{tabular}}{{{kinds}}}", r"\toprule", head, r"\midrule", *body, r"\bottomrule"]
        return "\n".join([f"% {self.caption}", *rows, r"\end{tabular}"]) + "\n"

    def write(self, folder: str | Path, name: str) -> list[Path]:
        """Write NAME.csv, NAME.md and NAME.tex; returns their paths."""
        texts = {"csv": self.csv(), "md": self.markdown(), "tex": self.latex()}
        return [write_bytes(Path(folder, f"{name}.{kind}"), text.encode()) for kind, text in texts.items()]


def escape(text: str) -> str:
    """Text as LaTeX prints it."""
    return "".join(f"\\{letter}" if letter in "&%$#_{}" else letter for letter in text)
