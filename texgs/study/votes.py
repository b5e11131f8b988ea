"""Table `user_study`: how people rank methods, beside the votes in the paper's appendix."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import asdict, astuple, dataclass, replace
from typing import Any

import numpy as np

from texgs.report.edit_tables import words_of
from texgs.report.metrics_files import Record, of
from texgs.report.published import meant, paper, volumes
from texgs.report.results import EditResult
from texgs.report.table import UNPUBLISHED, Column, Table
from texgs.study.ballots import Votes
from texgs.study.questions import KINDS, Compared
from texgs.study.rankings import CONFIDENCE, Rankings, firsts, friedman, together

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


def study_table(records: Sequence[Record[Any]], votes: Votes | None) -> Table:
    """Return the table of a study; without votes the paper's, where some jobs edit data sets of it."""
    is_shown = votes or any(meant(edit) in volumes() for edit in of(EditResult, records))
    table = user_study(votes)
    return table if is_shown else replace(table, rows=[])


def user_study(votes: Votes | None) -> Table:
    """Return the table of a study; without votes only those of the paper.

    Votes are added up over the data sets on which the same methods were compared.
    """
    groups = compared(votes)
    ranks = max(len(panels[0].votes.methods) for _, panels in groups)
    rows = [row for kind, panels in groups for row in rows_of(kind, panels)]
    numbered = [Column(f"rank {rank}", 0, UNPUBLISHED) for rank in range(1, ranks + 1)]
    names = [Column(title, None, UNPUBLISHED) for title in BEFORE]
    return Table(caption(votes), [*names, *numbered, *AFTER], rows)


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
    """Return the votes of each question, by what methods follow there."""
    panels: dict[str, list[Panel]] = defaultdict(list)
    for place, question in enumerate(votes.study.questions):
        methods = [option.compared for option in question.options]
        ranks = np.array([ballot.ranks[place] for ballot in votes.ballots])
        ranked = Rankings.of(methods, ranks).sorted(sorted(methods, key=astuple))
        panels[question.follows].append(Panel(question.dataset, words_of(question.followed), ranked))
    return panels


def published() -> dict[str, list[Panel]]:
    """Return the paper's votes, by what its methods follow."""
    votes = paper(
        "user_study", {"dataset": "dataset", "method": "method"}, {rank: rank for rank in PUBLISHED}
    )
    panels: dict[str, list[Panel]] = {follows: [] for follows in METHODS}
    for follows, table in METHODS.items():
        known = set(paper(table, {"method": "method"}, {})["method"])
        for dataset, lines in votes.groupby("dataset", sort=False):
            if set(lines["method"]) == known:
                methods = [Compared("-", THE_PAPER, name) for name in lines["method"]]
                counts = lines[list(PUBLISHED)].to_numpy(int)
                panels[follows].append(Panel(str(dataset), "-", Rankings(methods, counts)))
    return panels


def alike(panels: Iterable[Panel]) -> list[list[Panel]]:
    """Return the questions with the same methods together."""
    groups: dict[tuple[object, ...], list[Panel]] = defaultdict(list)
    for panel in panels:
        groups[tuple(panel.votes.methods)].append(panel)
    return list(groups.values())


def total(panels: Iterable[Panel]) -> Rankings:
    """Return the votes on questions that compare the same methods."""
    return together([panel.votes for panel in panels])


def rows_of(kind: str, panels: Sequence[Panel]) -> list[dict[str, Any]]:
    """Return rows of questions with the same methods: of each question, of all together, and of the test."""
    rows = []
    for panel in panels:
        names = {"kind": kind, "data set": panel.dataset, "follows": panel.followed}
        rows += [{**names, **row} for row in method_rows(panel.votes)]
    votes, every = total(panels), {"kind": kind, "data set": f"all {len(panels)}"}
    for row, share in zip(method_rows(votes), firsts(votes), strict=True):
        tested = {"from": share.low, "to": share.high, "p (binomial)": f"{share.p:.2g}"}
        rows.append({**every, "follows": "-", **row, **tested})
    test, edits = friedman(votes), {method.edit for method in votes.methods}
    rows.append({**every, "follows": "-", "recipe": "-", "method": "all"})
    rows[-1]["edit"] = edits.pop() if len(edits) == 1 else "-"
    rows[-1]["p (Friedman)"] = NO_BALLOTS if votes.ranks is None else TWO
    if test is not None:
        rows[-1] |= {"chi2 (Friedman)": test.statistic, "p (Friedman)": f"{test.p:.2g}"}
    return rows


def method_rows(votes: Rankings) -> list[dict[str, Any]]:
    """Return a row for each method, without tests."""
    return [
        {
            **asdict(method),
            **{f"rank {rank}": count for rank, count in enumerate(counts, start=1)},
            "mean rank": mean,
            "first": counts[0] / votes.number,
        }
        for method, counts, mean in zip(
            votes.methods, votes.counts.tolist(), votes.means.tolist(), strict=True
        )
    ]


def caption(votes: Votes | None) -> str:
    """Return what the columns are, and whose votes these are."""
    whose = (
        f"Study {votes.study.study}, {len(votes.ballots)} ballots." if votes else "No votes but the paper's."
    )
    return (
        f"{whose} Votes for each rank; rank 1 is the best. "
        f"`first` is the share of first ranks, with its exact {CONFIDENCE:.0%} interval and the two-sided "
        "binomial test against chance. Friedman's test takes each answer of each ballot as a block. "
        "The paper: ten participants; the same numbers from its counts of votes."
    )
