"""Write the tables that some metrics files hold, as CSV, Markdown and LaTeX."""

import argparse
import sys
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Where the numbers are, and where the tables go."""
    parser.add_argument("metrics", nargs="*", type=Path, help="metrics.json files (all below results/)")
    parser.add_argument("--missing", type=Path, help="JSON file of what was left out, with reasons")
    parser.add_argument(
        "--study",
        type=Path,
        default=Path("results/study/key.json"),
        help="key of a user study, with ballots in votes/ beside it (%(default)s)",
    )
    parser.add_argument("--output", type=Path, default=Path("results/tables"), help="folder (%(default)s)")


def run(arguments: argparse.Namespace) -> int:
    """Write the tables and print those that have rows."""
    from texgs.core.errors import ArgumentError
    from texgs.report.ballots import votes_beside
    from texgs.report.left_out import others, read_left_out
    from texgs.report.metrics_files import below, read_known
    from texgs.report.table_files import write_tables
    from texgs.report.tables import tables_of

    paths = arguments.metrics or below("results")
    if not paths:
        raise ArgumentError("tables: no metrics.json below results; run something first, such as make demo")
    records, old = read_known(paths)
    for entry in others(old):
        print(f"Left out: {entry}", file=sys.stderr)
    tables = tables_of(records, read_left_out(arguments.missing), votes_beside(arguments.study))
    write_tables(arguments.output, tables)
    for table in tables.values():
        if table.rows:
            print(table.markdown())
    return 0
