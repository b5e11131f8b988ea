"""Count the ballots of a user study: the table of its votes as CSV, Markdown and LaTeX, and a figure."""

import argparse
from pathlib import Path

NAME = "user_study"  # of the files


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Where the ballots and their key are, and where the table goes."""
    parser.add_argument(
        "ballots", nargs="*", type=Path, help="files that voters have sent (all in votes/ beside the key)"
    )
    parser.add_argument(
        "--key", type=Path, default=Path("results/study/key.json"), help="of the study (%(default)s)"
    )
    parser.add_argument("--output", type=Path, default=Path("results/tables"), help="folder (%(default)s)")


def run(arguments: argparse.Namespace) -> int:
    """Write the table and its figure, and print the table."""
    from texgs.core.errors import ArgumentError
    from texgs.report.ballots import read_votes
    from texgs.report.study import read_key
    from texgs.report.table_files import write_table
    from texgs.report.tables import of_study
    from texgs.report.votes_figure import write_votes

    study, folder = read_key(arguments.key), arguments.key.parent / "votes"
    ballots = arguments.ballots or sorted(folder.glob("*.csv"))
    if not ballots:
        raise ArgumentError(f"votes: no ballots in {folder}; put the files there that voters send")
    votes = read_votes(study, ballots)
    table = of_study(votes).table([])
    write_table(arguments.output, NAME, table)
    write_votes(arguments.output / f"{NAME}.png", votes)
    print(table.markdown())
    return 0
