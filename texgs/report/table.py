"""One table: a data frame that is written as CSV, Markdown and LaTeX; each row knows its metrics files."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from texgs.core.io import write_bytes
from texgs.report.latex import document, one_line, tabular

if TYPE_CHECKING:
    from pandas import DataFrame

MISSING = "not measured"
SOURCES = "metrics files"  # column of the paths that a row was read from
UNPUBLISHED = "-"  # in columns of the paper's numbers: it has none
UNLIKE = "≠"  # there: it has one, of something else
FORMATS = ("csv", "md", "tex")
DOCUMENT = "tables.tex"


@dataclass(frozen=True)
class Column:
    """One column: its heading and how its numbers are written."""

    title: str
    digits: int | None = None  # after the point; None: as they are
    missing: str = MISSING  # in place of a cell that has no value

    def text(self, cell: Any) -> str:
        """Return a cell as people read it."""
        if cell is None:
            return self.missing
        return str(cell) if isinstance(cell, str) or self.digits is None else f"{cell:,.{self.digits}f}"


@dataclass(frozen=True, eq=False)
class Table:
    """Rows with a value for each column; what was not measured says so."""

    caption: str
    columns: Sequence[Column]
    rows: DataFrame | Sequence[Mapping[str, Any]]  # by titles; SOURCES may be among them
    heading: str = ""

    @cached_property
    def frame(self) -> DataFrame:
        """Return the cells by title, with None for what is missing, and a list of paths in SOURCES."""
        titles = [*(column.title for column in self.columns), SOURCES]
        rows = data_frame(self.rows) if isinstance(self.rows, Sequence) else self.rows
        frame = rows.reindex(columns=titles).astype(object).reset_index(drop=True)
        frame = frame.where(frame.notna(), None)
        frame[SOURCES] = [sources or [] for sources in frame[SOURCES]]
        return frame

    @property
    def is_empty(self) -> bool:
        """Return whether there are no rows."""
        return len(self.rows) == 0

    def texts(self) -> list[list[str]]:
        """Return all cells as people read them."""
        texts = [map(column.text, self.frame[column.title].tolist()) for column in self.columns]
        return [list(row) for row in zip(*texts, strict=True)]

    def csv(self) -> str:
        """Return comma separated values, numbers in full; an empty cell has no number of its own."""
        sources = [" ".join(path.as_posix() for path in paths) for paths in self.frame[SOURCES]]
        frame = self.frame.assign(**{SOURCES: sources})
        return frame.where(frame != UNLIKE, None).to_csv(index=False, lineterminator="\n")

    def markdown(self) -> str:
        """Return a Markdown table, numbers to the right."""
        rule = ["---" if column.digits is None else "---:" for column in self.columns]
        lines = [[column.title for column in self.columns], rule, *self.texts()]
        rows = [" | ".join(one_line(text).replace("|", r"\|") for text in line) for line in lines]
        parts = [f"## {self.heading}"] if self.heading else []
        parts += ["\n".join(f"| {row} |" for row in rows), one_line(self.caption)]
        return "\n\n".join(parts) + "\n"

    def latex(self) -> str:
        """Return a tabular of LaTeX."""
        kinds = "".join("l" if column.digits is None else "r" for column in self.columns)
        return tabular(kinds, [column.title for column in self.columns], self.texts(), self.caption)


def data_frame(rows: Iterable[Mapping[str, Any]], columns: Sequence[str] | None = None) -> DataFrame:
    """Return rows as a data frame that keeps each value as it is; without rows it has the columns alone."""
    import pandas as pd  # slow to import

    return pd.DataFrame(list(rows), columns=columns, dtype=object)


def write_table(folder: str | Path, name: str, table: Table) -> None:
    """Write NAME.csv, NAME.md and NAME.tex."""
    for suffix, text in zip(FORMATS, (table.csv(), table.markdown(), table.latex()), strict=True):
        write_bytes(Path(folder, f"{name}.{suffix}"), text.encode())


def write_tables(folder: str | Path, tables: Mapping[str, Table]) -> None:
    """Write the files of each table, and tables.tex, which has those with rows and their captions."""
    for name, table in tables.items():
        write_table(folder, name, table)
    shown = {name: table for name, table in tables.items() if not table.is_empty}
    floats = {name: (table.heading or name, table.caption) for name, table in shown.items()}
    write_bytes(Path(folder, DOCUMENT), document(floats).encode())
