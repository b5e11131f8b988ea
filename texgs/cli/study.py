"""Make a user study of edited scenes: one HTML page for voters, and the key that tells what they saw."""

from __future__ import annotations

import argparse
import sys
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from texgs.cli.options import add_device, option
from texgs.cli.tables import given_path
from texgs.core.errors import ArgumentError

if TYPE_CHECKING:
    import torch

    from texgs.study.questions import Question

SMALLEST, LARGEST = 64, 1024  # sides of a clip, pixels
KEY, PAGE = "key.json", "ballot.html"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what to compare, how to show it, and where to."""
    parser.add_argument(
        "results", nargs="?", type=given_path, default=Path("results"), help="folder (results)"
    )
    parser.add_argument(
        "--edits", nargs="+", default=[], metavar="EDIT", help="edits to compare; default all with a new look"
    )
    parser.add_argument("--output", type=Path, help="folder; default study in the results")
    option(parser, "--seed", 0, "random seed for the order of clips")
    option(parser, "--size", 384, "width and height of a clip, pixels")
    option(parser, "--frames", 150, "frames of a turn, 25 a second")
    add_device(parser)


def run(arguments: argparse.Namespace) -> int:
    """Write ballot.html, then key.json; print the questions."""
    output = arguments.output or arguments.results / "study"
    key, page = output / KEY, output / PAGE
    if key.exists():
        raise ArgumentError(
            f"{key}: there is a study already, whose ballots need it; choose another --output, or remove it"
        )
    if not SMALLEST <= arguments.size <= LARGEST:
        raise ArgumentError(f"--size: expected {SMALLEST} to {LARGEST} pixels, got {arguments.size}")
    if arguments.frames < 1:
        raise ArgumentError(f"--frames: expected at least 1, got {arguments.frames}")
    if not arguments.results.is_dir():
        raise ArgumentError(f"{arguments.results}: expected a folder of results, got none")
    from texgs.core.check import torch_device
    from texgs.core.io import write_bytes
    from texgs.report.metrics_files import below, read_known, require_apart
    from texgs.study.ballot_page import ballot_page
    from texgs.study.questions import KINDS, Study, questions_of, write_key

    records, old = read_known(below(arguments.results))
    require_apart(records)
    for entry in old:
        print(f"Left out: {entry}", file=sys.stderr)
    questions = questions_of(records, arguments.edits, arguments.seed)
    films = films_of(questions, arguments.size, arguments.frames, torch_device(arguments.device))
    first = ballot_page("", questions, films, arguments.size)
    study = Study(sha256(first.encode()).hexdigest()[:12], arguments.seed, questions)
    text = ballot_page(study.study, questions, films, arguments.size)
    write_bytes(page, text.encode())
    write_key(key, study)
    for number, question in enumerate(questions, start=1):
        compared = ", ".join(sorted(option.edit for option in question.options))
        print(f"{number}. {question.dataset}, {KINDS[question.follows]}: {compared}")
    print(f"{page}: {len(text) / 1e6:.1f} MB, for voters")
    print(f"{key}: what the clips are, not for voters")
    return 0


def films_of(questions: list[Question], size: int, frames: int, device: torch.device) -> list[bytes]:
    """Return the film of each question, MP4."""
    from texgs.scene.scene_file import read_scene
    from texgs.study.ballot_page import write_film

    films = []
    with TemporaryDirectory() as folder:
        for number, question in enumerate(questions, start=1):
            files = [question.original, *(option.scene for option in question.options)]
            path = write_film(
                *(Path(folder, "film.mp4"), [read_scene(file) for file in files], size, frames, device),
                title=f"question {number} of {len(questions)}",
            )
            films.append(path.read_bytes())
    return films


def add_votes_arguments(parser: argparse.ArgumentParser) -> None:
    """Add where the ballots and their key are, and where the table goes."""
    parser.add_argument(
        "ballots", nargs="*", type=Path, help="files that voters have sent (all in votes/ beside the key)"
    )
    option(parser, "--key", Path("results/study/key.json"), "of the study")
    option(parser, "--output", Path("results/tables"), "folder")


def run_votes(arguments: argparse.Namespace) -> int:
    """Count the ballots of a user study: write the table and its figure, and print the table."""
    from texgs.report.table import write_table
    from texgs.report.tables import spec_of
    from texgs.study.ballots import read_votes
    from texgs.study.questions import read_key
    from texgs.study.votes import user_study, write_votes

    study, folder = read_key(arguments.key), arguments.key.parent / "votes"
    ballots = arguments.ballots or sorted(folder.glob("*.csv"))
    if not ballots:
        raise ArgumentError(f"votes: no ballots in {folder}; put the files there that voters send")
    votes = read_votes(study, ballots)
    spec = spec_of("user_study")
    table = spec.table([], given=user_study(votes))
    write_table(arguments.output, spec.name, table)
    write_votes(arguments.output / f"{spec.name}.png", votes)
    print(table.markdown())
    return 0
