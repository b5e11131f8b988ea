"""Table `user_study`: how people rank methods, beside the votes in the paper's appendix."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import astuple, dataclass

import numpy as np

from texgs.report.ballots import Votes
from texgs.report.looks import words_of
from texgs.report.metrics_files import paper
from texgs.report.rankings import CONFIDENCE, Rankings, firsts, friedman, together
from texgs.report.study import KINDS, Compared
from texgs.report.table import UNPUBLISHED, Cell, Column, Row, Table

METHODS = {"style": "image_npse", "instruction": "text_npse"}  # the paper's files that name those of a kind
PUBLISHED = ("best", "second_best", "second_worst", "worst")  # columns of the paper's file
BEFORE = ("kind", "data set", "follows", "recipe", "edit", "method")
AFTER = (
    Column("mean rank", 2, UNPUBLISHED),
    Column("first", 2, UNPUBLISHED),
    Column("from", 2, UNPUBLISHED),
    Column("to", 2, UNPUBLISHED),
    Column("p (binomial)", None, UNPUBLISHED),
    Column("chi2 (Friedman)", 2, UNPUBLISHED),
    Column("p (Friedman)", None, UNPUBLISHED),
)
THE_PAPER = "the paper"  # in place of an edit
NO_BALLOTS = "only counts are published"
TWO = "needs three methods"


@dataclass(frozen=True, eq=False)
class Panel:
    """The votes on one question."""

    dataset: str
    followed: str
    votes: Rankings


def user_study(votes: Votes | None) -> Table:
    """The table of a study; without votes only those of the paper.

    Votes are added up over the data sets on which the same methods were compared.
    """
    groups = compared(votes)
    ranks = max(len(panels[0].votes.methods) for _, panels in groups)
    rows = [row for kind, panels in groups for row in rows_of(kind, panels, ranks)]
    numbered = [Column(f"rank {rank}", 0, UNPUBLISHED) for rank in range(1, ranks + 1)]
    return Table(caption(votes), [*map(Column, BEFORE), *numbered, *AFTER], rows)


def compared(votes: Votes | None) -> list[tuple[str, list[Panel]]]:
    """Kinds of questions, each with all questions that compare the same methods; the paper's follow ours."""
    ours, theirs = counted(votes) if votes else {}, published()
    return [
        (KINDS[follows], panels)
        for follows in KINDS
        if follows in ours or not ours
        for panels in [*alike(ours.get(follows, [])), *alike(theirs[follows])]
    ]


def counted(votes: Votes) -> dict[str, list[Panel]]:
    """The votes of each question, by what methods follow there."""
    panels: dict[str, list[Panel]] = defaultdict(list)
    for place, question in enumerate(votes.study.questions):
        methods = [option.compared for option in question.options]
        ranks = np.array([ballot.ranks[place] for ballot in votes.ballots])
        ranked = Rankings.of(methods, ranks).sorted(sorted(methods, key=astuple))
        panels[question.follows].append(Panel(question.dataset, words_of(question.followed), ranked))
    return panels


def published() -> dict[str, list[Panel]]:
    """The paper's votes, by what its methods follow."""
    lines: dict[str, dict[str, list[int]]] = defaultdict(dict)  # by data set and method
    for (dataset, method), line in paper("user_study", keys=2).items():
        lines[dataset][method] = [int(line[rank]) for rank in PUBLISHED]
    panels: dict[str, list[Panel]] = {}
    for follows, table in METHODS.items():
        known = {method for (method,) in paper(table)}
        panels[follows] = [
            Panel(
                dataset,
                "-",
                Rankings([Compared("-", THE_PAPER, name) for name in by], np.array([*by.values()])),
            )
            for dataset, by in lines.items()
            if set(by) == known
        ]
    return panels


def alike(panels: Iterable[Panel]) -> list[list[Panel]]:
    """Questions with the same methods together."""
    groups: dict[tuple[object, ...], list[Panel]] = defaultdict(list)
    for panel in panels:
        groups[tuple(panel.votes.methods)].append(panel)
    return list(groups.values())


def total(panels: Iterable[Panel]) -> Rankings:
    """The votes on questions that compare the same methods."""
    return together([panel.votes for panel in panels])


def rows_of(kind: str, panels: Sequence[Panel], ranks: int) -> list[Row]:
    """Rows of questions with the same methods: of each question, of all together, and of the test of all."""
    rows = []
    for panel in panels:
        rows += method_rows([kind, panel.dataset, panel.followed], panel.votes, ranks)
    votes, name = total(panels), f"all {len(panels)}"
    shares: list[list[Cell]] = [[each.low, each.high, f"{each.p:.2g}"] for each in firsts(votes)]
    for row, share in zip(method_rows([kind, name, "-"], votes, ranks), shares, strict=True):
        rows.append(Row([*row.cells[: -len(share) - 2], *share, None, None], []))
    test, edits = friedman(votes), {method.edit for method in votes.methods}
    result: list[Cell] = [None, NO_BALLOTS if votes.ranks is None else TWO]
    if test is not None:
        result = [test.statistic, f"{test.p:.2g}"]
    edit = edits.pop() if len(edits) == 1 else "-"
    rows.append(Row([kind, name, "-", "-", edit, "all", *[None] * (ranks + 5), *result], []))
    return rows


def method_rows(start: Sequence[Cell], votes: Rankings, ranks: int) -> list[Row]:
    """A row for each method, without tests."""
    rows = []
    for method, counts, mean in zip(votes.methods, votes.counts.tolist(), votes.means.tolist(), strict=True):
        padded = [*counts, *[None] * (ranks - len(counts))]
        cells = [*start, *astuple(method), *padded, mean, counts[0] / votes.number]
        rows.append(Row([*cells, *[None] * 5], []))
    return rows


def caption(votes: Votes | None) -> str:
    """What the columns are, and whose votes these are."""
    whose = (
        f"Study {votes.study.study}, {len(votes.ballots)} ballots." if votes else "No votes but the paper's."
    )
    return (
        f"{whose} Votes for each rank; rank 1 is the best. "
        f"`first` is the share of first ranks, with its exact {CONFIDENCE:.0%} interval and the two-sided "
        "binomial test against chance. Friedman's test takes each answer of each ballot as a block. "
        "The paper: ten participants; the same numbers from its counts of votes."
    )
