"""Write one HTML file with the pictures, tables and provenance of all jobs."""

import argparse
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Where the numbers are, and where the report goes."""
    parser.add_argument("metrics", nargs="*", type=Path, help="metrics.json files (all below results/)")
    parser.add_argument("--missing", type=Path, help="JSON file of what was left out, with reasons")
    parser.add_argument(
        "--study",
        type=Path,
        default=Path("results/study/key.json"),
        help="key of a user study, with ballots in votes/ beside it (%(default)s)",
    )
    parser.add_argument("--output", type=Path, default=Path("results/report.html"), help="(%(default)s)")


def run(arguments: argparse.Namespace) -> int:
    """Write the report and print its path."""
    from texgs.core.errors import ArgumentError
    from texgs.report.ballots import votes_beside
    from texgs.report.html import write_report
    from texgs.report.left_out import read_left_out
    from texgs.report.metrics_files import below

    paths = arguments.metrics or below("results")
    if not paths:
        raise ArgumentError("report: no metrics.json below results; run something first, such as make demo")
    left_out, votes = read_left_out(arguments.missing), votes_beside(arguments.study)
    print(write_report(arguments.output, paths, left_out, votes))
    return 0
