"""Tables as files: CSV, Markdown and LaTeX each, and a LaTeX document of all."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from texgs.core.io import write_bytes
from texgs.report.latex import document, tabular
from texgs.report.table import Table

FORMATS = ("csv", "md", "tex")
DOCUMENT = "tables.tex"


def write_tables(folder: str | Path, tables: Mapping[str, Table]) -> None:
    """Write NAME.csv, NAME.md and NAME.tex of each table, and tables.tex, which has them all."""
    for name, table in tables.items():
        texts = dict(zip(FORMATS, (table.csv(), table.markdown(), tabular(table)), strict=True))
        for suffix, text in texts.items():
            write_bytes(Path(folder, f"{name}.{suffix}"), text.encode())
    write_bytes(Path(folder, DOCUMENT), document(tables).encode())
