"""Write the tables that some metrics files hold, as CSV, Markdown and LaTeX."""

import argparse
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Where the numbers are, and where the tables go."""
    parser.add_argument("metrics", nargs="*", type=Path, help="metrics.json files (all below results/)")
    parser.add_argument("--sweep", help="name of a sweep: the table of its variants, not of all fits")
    parser.add_argument("--output", type=Path, default=Path("results/tables"), help="folder (%(default)s)")


def run(arguments: argparse.Namespace) -> int:
    """Write the tables and print them."""
    from texgs.report.fitting import fitting
    from texgs.report.sweep import sweep

    paths = arguments.metrics or sorted(Path("results").rglob("metrics*.json"))
    table = sweep(paths, arguments.sweep) if arguments.sweep else fitting(paths)
    table.write(arguments.output, arguments.sweep or "fitting")
    print(table.markdown())
    return 0
