"""Write the tables that some metrics files hold, as CSV, Markdown and LaTeX."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from texgs.core.errors import ArgumentError

if TYPE_CHECKING:
    from texgs.report.metrics_files import LeftOut, Record
    from texgs.report.table import Table
    from texgs.study.ballots import Votes


def add_arguments(parser: argparse.ArgumentParser, output: str = "tables") -> None:
    """Add where the numbers are, and where the tables or the report go."""
    parser.add_argument(
        "metrics", nargs="*", type=given_path, help="metrics.json files, or a folder of results (results/)"
    )
    parser.add_argument("--missing", type=Path, help="JSON file of what was left out, with reasons")
    study = "key of a user study, with ballots in votes/ beside it; default study/key.json in the results"
    parser.add_argument("--study", type=Path, help=study)
    parser.add_argument("--output", type=Path, help=f"default {output} in the results")


def run(arguments: argparse.Namespace) -> int:
    """Write the tables and print those that have rows."""
    from texgs.report.metrics_files import read_left_out
    from texgs.report.table import write_tables
    from texgs.report.tables import tables_of
    from texgs.study.ballots import votes_beside

    require_there(arguments)
    records, old = records_of(arguments)
    for entry in old:
        print(f"Left out: {entry}", file=sys.stderr)
    given = given_tables(records, votes_beside(study_of(arguments)))
    tables = tables_of(records, read_left_out(arguments.missing), given)
    write_tables(arguments.output or results_of(arguments) / "tables", tables)
    for table in tables.values():
        if not table.is_empty:
            print(table.markdown())
    return 0


def add_report_arguments(parser: argparse.ArgumentParser) -> None:
    """Add where the numbers are, and where the report goes."""
    add_arguments(parser, "report.html")


def run_report(arguments: argparse.Namespace) -> int:
    """Write one HTML file with the pictures, tables and provenance of all jobs."""
    from texgs.report.html import write_report
    from texgs.report.metrics_files import read_left_out
    from texgs.study.ballots import votes_beside
    from texgs.study.votes import votes_figure

    require_there(arguments)
    records, old = records_of(arguments)
    left_out, votes = [*read_left_out(arguments.missing), *old], votes_beside(study_of(arguments))
    given = given_tables(records, votes)
    more = {} if given["user_study"].is_empty else {"study": [votes_figure(votes)]}
    output = arguments.output or results_of(arguments) / "report.html"
    print(write_report(output, records, left_out, given, more))
    return 0


def given_path(word: str) -> Path:
    """Return the path of a file or folder, which may have the key of results in front, as in other verbs."""
    return Path(word.removeprefix("results="))


def results_of(arguments: argparse.Namespace) -> Path:
    """Return the folder of results that is given; where it is none or several, results."""
    folders = [each for each in arguments.metrics if each.is_dir()]
    return folders[0] if len(folders) == len(arguments.metrics) == 1 else Path("results")


def require_there(arguments: argparse.Namespace) -> None:
    """Require the files that options name."""
    for name, writer in (("missing", "texgs run"), ("study", "texgs study")):
        path: Path | None = getattr(arguments, name)
        if path is not None and not path.is_file():
            raise ArgumentError(f"--{name}: expected a file that {writer} has written, got {path}")


def study_of(arguments: argparse.Namespace) -> Path:
    """Return the key of the study that is given, else of that of the results."""
    return arguments.study or results_of(arguments) / "study" / "key.json"


def records_of(arguments: argparse.Namespace) -> tuple[list[Record[Any]], list[LeftOut]]:
    """Read the metrics files that are given, or those of a folder, each once; tell of those left out."""
    from texgs.report.metrics_files import read_known, require_apart
    from texgs.workflow.graph import current_records

    given = arguments.metrics or [Path("results")]
    records, left_out = read_known(each for each in given if each.is_file())
    for folder in (each for each in given if not each.is_file()):
        if arguments.metrics and not folder.is_dir():
            raise ArgumentError(f"{folder}: expected a metrics file or a folder of results, got none")
        found, others = current_records(folder)
        records, left_out = [*records, *found], [*left_out, *others]
    if not records:
        raise ArgumentError(
            f"no whole results below {', '.join(map(str, given))}; run something first, such as "
            "texgs run dataset=engine"
        )
    records = [*{record.path.resolve(): record for record in reversed(records)}.values()][::-1]
    require_apart(records)
    return records, left_out


def given_tables(records: list[Record[Any]], votes: Votes | None) -> dict[str, Table]:
    """Make the tables that need more than metrics files: votes, and the configuration."""
    from texgs.report.differences import differences_of
    from texgs.study.votes import study_table

    return {"user_study": study_table(records, votes), "differences": differences_of(records)}
