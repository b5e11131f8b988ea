"""Read and check ballots: CSV files that the page of a study saves."""

import csv
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from texgs.core.errors import ArgumentError
from texgs.core.io import reading
from texgs.study.questions import Question, Study, read_key

COLUMNS = ["study", "ballot", "question", "option", "rank"]
MAX_BYTES = 1 << 20
FILE_WORDS, ADVICE = "a ballot", "ask the voter for the file that the page saves"


@dataclass(frozen=True)
class Ballot:
    """The ranks given by one voter."""

    ballot: str  # random id
    ranks: Sequence[Sequence[int]]  # by question, by option; 1 is the best


@dataclass(frozen=True)
class Votes:
    """A study and its ballots, at least one."""

    study: Study
    ballots: Sequence[Ballot]


def read_votes(study: Study, paths: Iterable[str | Path]) -> Votes:
    """Read the ballots of a study, in the order of their ids.

    Raises:
        ArgumentError: naming the file that is no complete ballot of this study, or one of another file with
            other answers.
    """
    by_id: dict[str, tuple[Path, Ballot]] = {}
    for path in sorted(map(Path, paths)):
        ballot = read_ballot(study, path)
        first, same = by_id.get(ballot.ballot, (path, ballot))
        if ballot != same:
            raise ArgumentError(
                f"{path}: expected another ballot than {first}, got other answers of the same one; keep one"
            )
        by_id[ballot.ballot] = (path, ballot)
    return Votes(study, [by_id[name][1] for name in sorted(by_id)])


def votes_beside(key: str | Path) -> Votes | None:
    """Return the ballots in the folder `votes` beside the key of a study; None without any.

    Raises:
        ArgumentError: as `read_votes` and `read_key`.
    """
    ballots = sorted(Path(key).parent.glob("votes/*.csv"))
    return read_votes(read_key(key), ballots) if ballots else None


def read_ballot(study: Study, path: Path) -> Ballot:
    """Read one ballot."""
    rows = rows_of(path)
    own = rows[0]["ballot"]
    for key, expected in (("study", study.study), ("ballot", own)):
        if got := next((row[key] for row in rows if row[key] != expected), None):
            advice = "count it with the key of its study" if key == "study" else ADVICE
            raise ArgumentError(f"{path}: expected {key} {expected}, got {got}; {advice}")
    given: dict[str, list[tuple[str, str]]] = {str(n): [] for n in range(1, len(study.questions) + 1)}
    for row in rows:
        if (number := row["question"]) not in given:
            raise ArgumentError(
                f"{path}: expected questions 1 to {len(given)}, got question {number}; {ADVICE}"
            )
        given[number].append((row["option"], row["rank"]))
    ranks = [
        ranks_of(f"{path}: question {number}", question, given[number])
        for number, question in zip(given, study.questions, strict=True)
    ]
    return Ballot(own, ranks)


def rows_of(path: Path) -> list[dict[str, str]]:
    """Return the lines of a ballot by column; at least one is required."""
    with reading(path, FILE_WORDS, ADVICE):
        if path.stat().st_size > MAX_BYTES:
            raise ArgumentError(
                f"{path}: expected {FILE_WORDS} of at most {MAX_BYTES} bytes; is it another file?"
            )
        lines = list(csv.reader(path.read_text(encoding="utf-8-sig").splitlines()))
    header, *rows = lines or [[]]
    if header != COLUMNS or any(len(row) != len(COLUMNS) for row in rows) or not rows:
        raise ArgumentError(f"{path}: expected {FILE_WORDS} with the columns {', '.join(COLUMNS)}; {ADVICE}")
    return [dict(zip(COLUMNS, row, strict=True)) for row in rows]


def ranks_of(where: str, question: Question, given: Sequence[tuple[str, str]]) -> list[int]:
    """Return the rank of each option of a question, from a ballot's options and ranks."""
    count, ranks = len(question.letters), dict(given)
    expected = sorted(str(rank) for rank in range(1, count + 1))
    if sorted(option for option, _ in given) != list(question.letters) or sorted(ranks.values()) != expected:
        got = ", ".join(f"{option} {rank}" for option, rank in given) or "none"
        raise ArgumentError(
            f"{where}: expected ranks from 1 to {count}, one for each of {', '.join(question.letters)}, got "
            f"{got}; {ADVICE}"
        )
    return [int(ranks[letter]) for letter in question.letters]
