"""Table and figure of a user study: ranks of methods beside the votes in the paper's appendix."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import asdict, astuple, dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image

from texgs.core.figures import new_figure, words, write_figure
from texgs.report.edit_tables import words_of
from texgs.report.metrics_files import Record, of
from texgs.report.published import intended_dataset, paper, volumes
from texgs.report.results import EditResult
from texgs.report.sections import Figure, data_uri
from texgs.report.table import UNPUBLISHED_CELL, Column, Table
from texgs.study.ballots import Votes
from texgs.study.questions import KINDS, Compared, rank_name
from texgs.study.rankings import CONFIDENCE, Rankings, firsts, friedman, interval, pool

if TYPE_CHECKING:
    from matplotlib.axes import Axes

METHODS = {"style": "image_npse", "instruction": "text_npse"}  # the paper's files of methods, by kind
PAPER_COLUMNS = ("best", "second_best", "second_worst", "worst")  # columns of the paper's file
LABELS = ("kind", "data set", "follows", "recipe", "edit", "method")
STATISTICS = (
    Column("mean rank", 2, UNPUBLISHED_CELL),
    Column("first", 2, UNPUBLISHED_CELL),
    Column("from", 2, UNPUBLISHED_CELL),
    Column("to", 2, UNPUBLISHED_CELL),
    Column("p (binomial)", None, UNPUBLISHED_CELL),
    Column("chi2 (Friedman)", 2, UNPUBLISHED_CELL),
    Column("p (Friedman)", None, UNPUBLISHED_CELL),
)
PAPER_LABEL = "the paper"  # edit column in rows of the paper's votes
NO_BALLOTS_NOTE = "only counts are published"
TOO_FEW_NOTE = "needs three methods"
WIDTH, DPI = 5.0, 150  # inches of a chart
BAR_HEIGHT, CHART_MARGIN = 0.35, 1.0  # inches: a bar, and the space above and below a chart


@dataclass(frozen=True, eq=False)
class Panel:
    """The votes on one question."""

    dataset: str
    followed: str
    votes: Rankings


def study_table(records: Sequence[Record[Any]], votes: Votes | None) -> Table:
    """Return the table of a study; without votes, the paper's table if jobs edit its data sets."""
    is_shown = votes or any(intended_dataset(edit) in volumes() for edit in of(EditResult, records))
    table = user_study(votes)
    return table if is_shown else replace(table, rows=[])


def user_study(votes: Votes | None) -> Table:
    """Return the table of a study; without votes, only the paper's votes.

    Votes are added up over the data sets on which the same methods were compared.
    """
    groups = panels_by_kind(votes)
    ranks = max(len(panels[0].votes.methods) for _, panels in groups)
    rows = [row for kind, panels in groups for row in rows_of(kind, panels)]
    numbered = [Column(f"rank {rank}", 0, UNPUBLISHED_CELL) for rank in range(1, ranks + 1)]
    names = [Column(title, None, UNPUBLISHED_CELL) for title in LABELS]
    return Table(caption(votes), [*names, *numbered, *STATISTICS], rows)


def panels_by_kind(votes: Votes | None) -> list[tuple[str, list[Panel]]]:
    """Return the questions by kind and compared methods; the paper's follow ours."""
    ours, theirs = panels_of_study(votes) if votes else {}, panels_of_paper()
    return [
        (KINDS[follows], panels)
        for follows in KINDS
        if follows in ours or not ours
        for panels in [*alike(ours.get(follows, [])), *alike(theirs[follows])]
    ]


def panels_of_study(votes: Votes) -> dict[str, list[Panel]]:
    """Return the votes of each question, by kind."""
    panels: dict[str, list[Panel]] = defaultdict(list)
    for place, question in enumerate(votes.study.questions):
        methods = [option.compared for option in question.options]
        ranks = np.array([ballot.ranks[place] for ballot in votes.ballots])
        ranked = Rankings.of(methods, ranks).sorted(sorted(methods, key=astuple))
        panels[question.follows].append(Panel(question.dataset, words_of(question.followed), ranked))
    return panels


def panels_of_paper() -> dict[str, list[Panel]]:
    """Return the paper's votes, by kind."""
    keys, numbers = ({name: name for name in names} for names in (("dataset", "method"), PAPER_COLUMNS))
    votes = paper("user_study", keys, numbers)
    panels: dict[str, list[Panel]] = {follows: [] for follows in METHODS}
    for follows, table in METHODS.items():
        known = set(paper(table, {"method": "method"}, {})["method"])
        for dataset, lines in votes.groupby("dataset", sort=False):
            if set(lines["method"]) == known:
                methods = [Compared("-", PAPER_LABEL, name) for name in lines["method"]]
                counts = lines[list(PAPER_COLUMNS)].to_numpy(int)
                panels[follows].append(Panel(str(dataset), "-", Rankings(methods, counts)))
    return panels


def alike(panels: Iterable[Panel]) -> list[list[Panel]]:
    """Group the questions with the same methods."""
    groups: dict[tuple[object, ...], list[Panel]] = defaultdict(list)
    for panel in panels:
        groups[tuple(panel.votes.methods)].append(panel)
    return list(groups.values())


def total(panels: Iterable[Panel]) -> Rankings:
    """Return all votes on questions that compare the same methods."""
    return pool([panel.votes for panel in panels])


def rows_of(kind: str, panels: Sequence[Panel]) -> list[dict[str, Any]]:
    """Return rows of questions with the same methods: of each question, of all together, and of the test."""
    rows = []
    for panel in panels:
        names = {"kind": kind, "data set": panel.dataset, "follows": panel.followed}
        rows += [{**names, **row} for row in method_rows(panel.votes)]
    votes, every = total(panels), {"kind": kind, "data set": f"all {len(panels)}"}
    for row, first in zip(method_rows(votes), firsts(votes), strict=True):
        low, high = interval(first)
        tested = {"from": low, "to": high, "p (binomial)": f"{first.pvalue:.2g}"}
        rows.append({**every, "follows": "-", **row, **tested})
    test, edits = friedman(votes), {method.edit for method in votes.methods}
    rows.append({**every, "follows": "-", "recipe": "-", "method": "all"})
    rows[-1]["edit"] = edits.pop() if len(edits) == 1 else "-"
    rows[-1]["p (Friedman)"] = NO_BALLOTS_NOTE if votes.ranks is None else TOO_FEW_NOTE
    if test is not None:
        rows[-1] |= {"chi2 (Friedman)": test[0], "p (Friedman)": f"{test[1]:.2g}"}
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
    """Return the caption: the columns, and the voters."""
    ours = f"Study {votes.study.study}, {len(votes.ballots)} ballots." if votes else ""
    whose = ours or "No votes but the paper's."
    return (
        f"{whose} Votes for each rank; rank 1 is the best. "
        f"`first` is the share of first ranks, with its exact {CONFIDENCE:.0%} interval and the two-sided "
        "binomial test against chance. Friedman's test takes each answer of each ballot as a block. "
        "The paper: ten participants; the same numbers from its counts of votes."
    )


def write_votes(path: str | Path, votes: Votes | None) -> Path:
    """Write a PNG with a chart for each kind of question, ours and the paper's below each other."""
    charts = panels_by_kind(votes)
    heights = [CHART_MARGIN + BAR_HEIGHT * len(panels[0].votes.methods) for _, panels in charts]
    figure = new_figure(WIDTH, sum(heights), DPI)
    places = figure.subplots(len(charts), squeeze=False, height_ratios=heights)[:, 0]
    for axes, (kind, panels) in zip(places, charts, strict=True):
        draw(axes, kind, panels)
    return write_figure(path, figure)


def votes_figure(votes: Votes | None) -> Figure:
    """Return the figure for the report."""
    with TemporaryDirectory() as folder, Image.open(write_votes(Path(folder, "votes.png"), votes)) as picture:
        command = "texgs votes" if votes else ""
        return Figure("votes", "", "Votes for each rank.", data_uri(picture), command, is_narrow=True)


def draw(axes: Axes, kind: str, panels: Sequence[Panel]) -> None:
    """Draw a stacked bar for each method, with its votes from the best rank to the worst."""
    from matplotlib import colormaps  # slow to import

    votes = total(panels)
    names, count = [words(name_of(method)) for method in votes.methods], len(votes.methods)
    starts = np.zeros(count)
    for rank, column in enumerate(votes.counts.T, start=1):
        color = colormaps["viridis"](1 - (rank - 0.5) / count)
        axes.barh(names, column, left=starts, height=0.7, color=color, label=rank_name(rank, count))
        starts += column
    axes.invert_yaxis()
    axes.set_xlim(0, votes.number)
    axes.set_xlabel("votes", fontsize=8)
    axes.tick_params(labelsize=8)
    axes.spines[["top", "right"]].set_visible(False)
    source = f", {PAPER_LABEL}" if votes.methods[0].edit == PAPER_LABEL else ""
    axes.set_title(f"{kind}{source}: {votes.number} rankings of {len(panels)} questions", fontsize=9)
    axes.legend(fontsize=7, ncols=count, loc="upper center", bbox_to_anchor=(0.5, -0.25), frameon=False)


def name_of(method: Compared) -> str:
    """Return the label of a bar."""
    return method.method if method.edit == PAPER_LABEL else f"{method.edit}\n{method.recipe}"
