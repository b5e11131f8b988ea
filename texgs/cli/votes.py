"""Count the ballots of a user study: the table of its votes as CSV, Markdown and LaTeX, and a figure."""

import argparse
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add where the ballots and their key are, and where the table goes."""
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
    from texgs.report.table import write_table
    from texgs.report.tables import STUDY
    from texgs.study.ballots import read_votes
    from texgs.study.questions import read_key
    from texgs.study.votes import user_study
    from texgs.study.votes_figure import write_votes

    study, folder = read_key(arguments.key), arguments.key.parent / "votes"
    ballots = arguments.ballots or sorted(folder.glob("*.csv"))
    if not ballots:
        raise ArgumentError(f"votes: no ballots in {folder}; put the files there that voters send")
    votes = read_votes(study, ballots)
    table = STUDY.table([], given=user_study(votes))
    write_table(arguments.output, STUDY.name, table)
    write_votes(arguments.output / f"{STUDY.name}.png", votes)
    print(table.markdown())
    return 0
