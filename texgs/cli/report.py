"""Write one HTML file with the pictures, tables and provenance of all jobs."""

import argparse


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add where the numbers are, and where the report goes."""
    from texgs.cli import tables

    tables.add_arguments(parser, "results/report.html")


def run(arguments: argparse.Namespace) -> int:
    """Write the report and print its path."""
    from texgs.cli.tables import given_tables, records_of
    from texgs.report.html import write_report
    from texgs.report.metrics_files import read_left_out
    from texgs.study.ballots import votes_beside
    from texgs.study.votes import shown

    records, old = records_of(arguments, "report")
    left_out, votes = [*read_left_out(arguments.missing), *old], votes_beside(arguments.study)
    given = given_tables(records, votes)
    more = {} if given["user_study"].is_empty else {"study": [shown(votes)]}
    print(write_report(arguments.output, records, left_out, given, more))
    return 0
