"""Tables as files: CSV, Markdown and LaTeX each, and a LaTeX document of all."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from texgs.core.io import write_bytes
from texgs.report.latex import document, tabular
from texgs.report.table import Table

FORMATS = ("csv", "md", "tex")
DOCUMENT = "tables.tex"


def write_table(folder: str | Path, name: str, table: Table) -> None:
    """Write NAME.csv, NAME.md and NAME.tex."""
    for suffix, text in zip(FORMATS, (table.csv(), table.markdown(), tabular(table)), strict=True):
        write_bytes(Path(folder, f"{name}.{suffix}"), text.encode())


def write_tables(folder: str | Path, tables: Mapping[str, Table]) -> None:
    """Write the files of each table, and tables.tex, which has them all."""
    for name, table in tables.items():
        write_table(folder, name, table)
    write_bytes(Path(folder, DOCUMENT), document(tables).encode())
