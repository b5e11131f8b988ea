"""User study: the edited scenes compared in each question, and the key that identifies them.

A question shows the scenes of one data set that follow the same pictures or the same instructions, side by
side in random order and without names, as in the paper (section User Study).
"""

import random
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from string import ascii_uppercase as LETTERS
from typing import Any

from texgs.core.errors import ArgumentError
from texgs.core.io import is_there, read_json, reading, write_json
from texgs.core.keys import typed
from texgs.core.names import SCENE, STYLE
from texgs.report.metrics_files import Record, of
from texgs.report.results import EditResult, FitResult, SceneResult

KINDS = {"style": "image-driven", "instruction": "text-driven"}  # kinds of questions, by what methods follow


@dataclass(frozen=True)
class Compared:
    """The subject of votes: an edit of the fits of a recipe."""

    recipe: str
    edit: str
    method: str


@dataclass(frozen=True)
class Option(Compared):
    """One clip of a question."""

    scene: str  # file

    @property
    def compared(self) -> Compared:
        """Return the subject of its votes."""
        return Compared(self.recipe, self.edit, self.method)


@dataclass(frozen=True)
class Question:
    """Clips to rank; an option's letter follows from its place."""

    dataset: str
    follows: str  # a key of KINDS
    followed: dict[str, str]  # picture or instruction, by model
    original: str  # file of the scene before the edits
    pictures: list[str]  # files of the pictures that methods follow
    options: list[Option]

    @property
    def letters(self) -> str:
        """Return the names of the options."""
        return LETTERS[: len(self.options)]


@dataclass(frozen=True)
class Study:
    """All questions, in their order."""

    study: str  # digest of the content for voters
    seed: int
    questions: list[Question]


def questions_of(records: Iterable[Record[Any]], edits: Sequence[str], seed: int) -> list[Question]:
    """Return all questions for edited scenes, those about pictures first, with options in random order.

    Without names of edits all are compared.
    """
    records = list(records)
    looks = [record for record in of(EditResult, records) if record.result.follows]
    if not looks:
        raise ArgumentError(
            "study: no scenes with a new look among the results; run something first, such as "
            "texgs run experiment=paper_text_quick"
        )
    known = sorted({record.result.edit for record in looks})
    for name in edits:
        if name not in known:
            raise ArgumentError(f"--edits: expected some of {', '.join(known)}, got {name}")
    groups: dict[tuple[int, str, str], list[Record[EditResult]]] = defaultdict(list)
    for record in looks:
        if not edits or record.result.edit in edits:
            place = list(KINDS).index(record.result.follows)
            groups[place, record.dataset, str(sorted(record.result.followed.items()))].append(record)
    order = random.Random(seed)
    questions = [question_of(groups[key], records, order) for key in sorted(groups) if len(groups[key]) > 1]
    if not questions:
        alone = ", ".join(f"{group[0].dataset} {group[0].result.edit}" for group in groups.values())
        raise ArgumentError(
            "study: expected two scenes or more of a data set that follow the same picture or instruction, "
            f"got only one of each ({alone}); run edits of other methods"
        )
    return questions


def question_of(
    looks: Sequence[Record[EditResult]], records: Sequence[Record[Any]], order: random.Random
) -> Question:
    """Return the question that compares some scenes."""
    first = looks[0]
    if len(looks) > len(LETTERS):
        raise ArgumentError(
            f"study: expected at most {len(LETTERS)} scenes in a question, got {len(looks)} of "
            f"{first.dataset}; choose some with --edits"
        )
    options = [
        Option(each.label, each.result.edit, each.result.method, each.path.with_name(SCENE).as_posix())
        for each in looks
    ]
    order.shuffle(options)
    original = original_of(first.dataset, {fit_of(record) for record in looks}, records)
    names = [name for name in first.facts.get("pictures", {}) if name.startswith(STYLE)]
    pictures = [first.path.with_name(name).as_posix() for name in names]
    followed = dict(first.result.followed)
    return Question(first.dataset, first.result.follows, followed, original.as_posix(), pictures, options)


def original_of(dataset: str, fits: set[str], records: Sequence[Record[Any]]) -> Path:
    """Return the unedited scene, of the fits closest to their test views."""
    scenes = {
        fit_of(record): record.path.with_name(SCENE)
        for record in of(SceneResult, records)
        if record.dataset == dataset and fit_of(record) in fits
    }
    if not scenes:
        raise ArgumentError(
            f"study: no scene of {dataset} by {', '.join(sorted(fits))} before its edits among the "
            "results; texgs compose makes it"
        )
    psnr: dict[str, dict[str | None, float]] = defaultdict(dict)  # by fit and TF, of the best phase
    for record in of(FitResult, records):
        if record.dataset == dataset and fit_of(record) in scenes and record.result.psnr is not None:
            best = psnr[fit_of(record)]
            best[record.tf] = max(record.result.psnr, best.get(record.tf, record.result.psnr))
    return scenes[max(sorted(scenes), key=lambda fit: sum(psnr[fit].values()))]


def fit_of(record: Record[Any]) -> str:
    """Return the folder of a job's fit, see `texgs.workflow.stage`: variants of an edit have the same."""
    return record.path.parents[2 if isinstance(record.result, EditResult) else 1].name


def rank_name(rank: int, count: int) -> str:
    """Return the name of a rank; of four best, second-best, second-worst and worst, as in the paper."""
    if rank in (1, count):
        return "best" if rank == 1 else "worst"
    if rank == 2:
        return "second-best"
    return "second-worst" if rank == count - 1 else f"rank {rank}"


def write_key(path: str | Path, study: Study) -> Path:
    """Write the scene of each option as JSON, hidden from voters."""
    return write_json(path, asdict(study))


def read_key(path: str | Path) -> Study:
    """Read the key of a study.

    Raises:
        ArgumentError: if the file is missing or no key.
    """
    advice = "texgs study writes one"
    if not is_there(path):
        raise ArgumentError(f"{path}: no such file; {advice}")
    with reading(path, "the key of a study", advice):
        study = typed(Study, read_json(path))
    for number, question in enumerate(study.questions, start=1):
        known, count = question.follows in KINDS, len({option.compared for option in question.options})
        if not known or not 2 <= count == len(question.letters):
            raise ArgumentError(
                f"{path}: question {number}: expected 2 to {len(LETTERS)} different options that follow "
                f"{' or '.join(KINDS)}, got {count} of {len(question.options)} and {question.follows}; "
                f"{advice}"
            )
    if not study.questions:
        raise ArgumentError(f"{path}: expected questions, got none; {advice}")
    return study
