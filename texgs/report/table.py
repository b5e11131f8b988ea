"""One table: a data frame written as CSV, Markdown and LaTeX; each row lists its metrics files."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

from texgs.core.io import write_bytes
from texgs.core.plain_yaml import parse_yaml

if TYPE_CHECKING:
    from pandas import DataFrame

MISSING_CELL = "not measured"
SOURCES = "metrics files"  # column of the source paths of a row
UNPUBLISHED_CELL = "-"  # cell of a number missing from the paper
PAPER = " (paper)"  # suffix of titles of the paper's columns
UNLIKE_CELL = "≠"  # cell for a number of the paper that is not comparable
FORMATS = ("csv", "md", "tex")
DOCUMENT = "tables.tex"
FORMULAS = r"""± \pm  × \times  ° ^\circ  · \cdot  ≠ \neq  ≤ \leq  ≥ \geq  → \rightarrow  ↑ \uparrow
  ↓ \downarrow  − -  ² ^2  ³ ^3  α \alpha  β \beta  λ \lambda  µ \mu  μ \mu  σ \sigma"""
LATEX_LETTERS = {  # LaTeX's spelling of special letters
    **{letter: f"${formula}$" for letter, formula in re.findall(r"(\S) (\S+)", FORMULAS)},
    **{letter: f"\\{letter}" for letter in "&%$#_{}"},
    **{"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "…": r"\ldots{}"},
    **{"[": "{[}", "]": "{]}"},  # after a row, brackets would be an argument
    **{"–": "--", "—": "---", "‘": "`", "’": "'", "“": "``", "”": "''"},
}
FLOAT = r"""\begin{table}[p]
\centering
\textbf{%s}

\medskip
%s

\medskip
\fitted{%s.tex}
\end{table}
\clearpage
"""


@dataclass(frozen=True)
class Column:
    """One column: heading and number format."""

    title: str
    digits: int | None = None  # after the point; None: unrounded
    missing: str = MISSING_CELL  # text of an empty cell

    @property
    def is_number(self) -> bool:
        """Return whether its cells are numbers, which are right-aligned."""
        return self.digits is not None

    def text(self, cell: Any) -> str:
        """Format a cell for readers."""
        if cell is None:
            return self.missing
        return str(cell) if isinstance(cell, str) or self.digits is None else f"{cell:,.{self.digits}f}"


@cache
def tables_file() -> dict[str, dict[str, Any]]:
    """Return the entries of tables.yaml by the names of tables."""
    tables: dict[str, dict[str, Any]] = parse_yaml(report_file("tables.yaml"))
    return tables


def report_file(name: str) -> str:
    """Return the text of a file beside this module."""
    return files("texgs.report").joinpath(name).read_text(encoding="utf-8")


def columns(name: str) -> dict[str, Column]:
    """Return the columns of a table by their keys in tables.yaml."""
    listed = tables_file()[name]["columns"]
    return {key: Column(**{"title": key, **facts}) for key, facts in listed.items()}


@dataclass(frozen=True, eq=False)
class Table:
    """Rows with a value for each column, or a text for missing ones."""

    caption: str
    columns: Sequence[Column]
    rows: DataFrame | Sequence[Mapping[str, Any]]  # by titles; SOURCES may be among them
    heading: str = ""

    @property
    def titles(self) -> list[str]:
        """Return the headings of all columns."""
        return [column.title for column in self.columns]

    @cached_property
    def frame(self) -> DataFrame:
        """Return the cells by title, with None for what is missing, and a list of paths in SOURCES."""
        rows = data_frame(self.rows) if isinstance(self.rows, Sequence) else self.rows
        frame = rows.reindex(columns=[*self.titles, SOURCES]).astype(object).reset_index(drop=True)
        frame = frame.where(frame.notna(), None)
        frame[SOURCES] = [sources or [] for sources in frame[SOURCES]]
        return frame

    @property
    def is_empty(self) -> bool:
        """Return whether there are no rows."""
        return len(self.rows) == 0

    def has(self, title: str) -> bool:
        """Return whether a column has a value in any row."""
        return bool(self.frame[title].notna().any())

    @cached_property
    def texts(self) -> DataFrame:
        """Format all cells for readers."""
        return data_frame({c.title: list(map(c.text, self.frame[c.title].tolist())) for c in self.columns})

    def csv(self) -> str:
        """Return comma-separated values with full precision; cells without a number are empty."""
        sources = [" ".join(path.as_posix() for path in paths) for paths in self.frame[SOURCES]]
        frame = self.frame.assign(**{SOURCES: sources})
        return frame.where(frame != UNLIKE_CELL, None).to_csv(index=False, lineterminator="\n")

    def markdown(self) -> str:
        """Return a Markdown table with right-aligned numbers."""
        rule = ["---:" if column.is_number else "---" for column in self.columns]
        lines = [self.titles, rule, *self.texts.to_numpy().tolist()]
        rows = [" | ".join(one_line(text).replace("|", r"\|") for text in line) for line in lines]
        parts = [f"## {self.heading}"] if self.heading else []
        parts += ["\n".join(f"| {row} |" for row in rows), one_line(self.caption)]
        return "\n\n".join(parts) + "\n"

    def latex(self) -> str:
        """Return a tabular of LaTeX between rules of booktabs, with the caption as a comment."""
        kinds = "".join("r" if column.is_number else "l" for column in self.columns)
        texts = self.texts.map(escape).rename(columns=escape)
        return f"% {one_line(self.caption)}\n" + texts.to_latex(index=False, column_format=kinds)


def data_frame(rows: Any, columns: Sequence[str] | None = None) -> DataFrame:
    """Return rows as a data frame with unchanged values; without rows it has only columns."""
    import pandas as pd  # slow to import

    return pd.DataFrame(rows, columns=columns, dtype=object)


def write_table(folder: str | Path, name: str, table: Table) -> None:
    """Write NAME.csv, NAME.md and NAME.tex."""
    for suffix, text in zip(FORMATS, (table.csv(), table.markdown(), table.latex()), strict=True):
        write_bytes(Path(folder, f"{name}.{suffix}"), text.encode())


def write_tables(folder: str | Path, tables: Mapping[str, Table]) -> None:
    """Write the files of each table, and tables.tex with all non-empty tables and their captions."""
    floats = []
    for name, table in tables.items():
        write_table(folder, name, table)
        if not table.is_empty:
            floats.append(FLOAT % (escape(table.heading or name), escape(table.caption), name))
    text = "".join([report_file(DOCUMENT), *floats, "\\end{document}\n"])
    write_bytes(Path(folder, DOCUMENT), text.encode())


def escape(text: str) -> str:
    """Escape text for LaTeX in one line; letters missing from pdflatex's fonts become codes."""
    return "".join(map(latex_letter, one_line(text)))


def latex_letter(letter: str) -> str:
    """Return LaTeX's spelling of a letter."""
    if letter in LATEX_LETTERS:
        return LATEX_LETTERS[letter]
    is_accented = "LATIN" in unicodedata.name(letter, "") and ord(letter) <= 0x17F  # the encoding T1 has it
    return letter if letter.isascii() or is_accented else rf"\texttt{{U+{ord(letter):04X}}}"


def one_line(text: str) -> str:
    """Return text without line breaks, which end a row of a table."""
    return " ".join(text.split())
