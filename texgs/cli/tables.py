"""Write the tables that some metrics files hold, as CSV, Markdown and LaTeX."""

import argparse
import re
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Where the numbers are, and where the tables go."""
    parser.add_argument("metrics", nargs="*", type=Path, help="metrics.json files (all below results/)")
    parser.add_argument("--sweep", help="name of a sweep: the table of its variants, not of all fits")
    parser.add_argument("--output", type=Path, default=Path("results/tables"), help="folder (%(default)s)")


def run(arguments: argparse.Namespace) -> int:
    """Write the tables and print them."""
    from texgs.core.errors import ArgumentError
    from texgs.report.metrics_files import below, read
    from texgs.report.sweep import sweep
    from texgs.report.tables import TABLES

    paths = arguments.metrics or below("results")
    if not paths:
        raise ArgumentError("tables: no metrics.json below results; run something first, such as make demo")
    if arguments.sweep and not re.fullmatch(r"[A-Za-z0-9_-]+", arguments.sweep):
        raise ArgumentError(f"--sweep: expected letters, digits, _ or -, got {arguments.sweep!r}")
    if arguments.sweep:
        tables = {f"sweep-{arguments.sweep}": sweep(read(paths), arguments.sweep)}
    else:
        records = read(paths)
        tables = {name: make(records) for name, make in TABLES.items()}
    for name, table in tables.items():
        table.write(arguments.output, name)
        print(table.markdown())
    return 0
