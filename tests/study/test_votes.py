"""The table and the figure of a study beside the paper's votes."""

from dataclasses import replace
from math import comb

import pytest
from matplotlib.figure import Figure
from PIL import Image

from tests.report.written import lines, rows
from tests.study.studies import study
from texgs.study.ballots import Ballot, Votes
from texgs.study.votes import draw, panels_by_kind, user_study, write_votes

STUDY = study("xyz", "zyx")
BALLOTS = [  # ranks by letter: x is the best, y is mostly second
    Ballot("aa", [[1, 2, 3], [3, 2, 1]]),
    Ballot("bb", [[1, 3, 2], [3, 2, 1]]),
]


def test_votes_go_to_methods_whatever_their_letter():
    table = user_study(Votes(STUDY, BALLOTS))
    ours = [row for row in rows(table) if row["edit"] != "the paper"]
    columns = ("data set", "method", "rank 1", "rank 2", "rank 3")
    assert [tuple(row[title] for title in columns) for row in ours] == [
        ("data1", "x", 2, 0, 0),
        ("data1", "y", 0, 1, 1),
        ("data1", "z", 0, 1, 1),
        ("data2", "x", 2, 0, 0),
        ("data2", "y", 0, 2, 0),
        ("data2", "z", 0, 0, 2),
        ("all 2", "x", 4, 0, 0),
        ("all 2", "y", 0, 3, 1),
        ("all 2", "z", 0, 1, 3),
        ("all 2", "all", None, None, None),
    ]
    best, test = ours[6], ours[-1]
    assert (best["kind"], best["recipe"], best["edit"]) == ("image-driven", "quick", "edit_x")
    assert (best["mean rank"], best["first"], best["to"]) == (1.0, 1.0, 1.0)
    assert best["p (binomial)"] == "0.012", "1 in 81"
    assert test["chi2 (Friedman)"] == pytest.approx(12 / (4 * 3 * 4) * (4**2 + 9**2 + 11**2) - 3 * 4 * 4)
    assert best["rank 4"] is None
    assert best["p (Friedman)"] is None
    assert "Study 0123456789ab, 2 ballots." in table.caption


def test_the_papers_votes_stand_beside_with_what_its_counts_tell():
    theirs = [row for row in rows(user_study(Votes(STUDY, BALLOTS))) if row["edit"] == "the paper"]
    assert {row["kind"] for row in theirs} == {"image-driven"}
    total = {row["method"]: row for row in theirs if row["data set"] == "all 4"}
    best = total["TexGS-VolVis"]
    assert [best[f"rank {rank}"] for rank in (1, 2, 3, 4)] == [27, 8, 3, 2]
    assert best["first"] == 27 / 40
    assert best["mean rank"] == pytest.approx((27 + 16 + 9 + 8) / 40)
    assert best["from"] < 27 / 40 < best["to"]
    above = sum(comb(40, k) * 0.25**k * 0.75 ** (40 - k) for k in range(27, 41))
    assert best["p (binomial)"] == f"{above:.2g}", "no lower number is as rare"
    assert total["all"]["p (Friedman)"] == "only counts are published"


def test_each_kind_has_its_own_votes_and_the_papers_for_it():
    both = replace(STUDY, questions=[*STUDY.questions, *study("vw", follows="instruction").questions])
    ballots = [replace(each, ranks=[*each.ranks, [1, 2]]) for each in BALLOTS]
    entries = rows(user_study(Votes(both, ballots)))
    text = [row for row in entries if row["kind"] == "text-driven"]
    assert [row["p (Friedman)"] for row in text if row["method"] == "all"] == [
        "needs three methods",
        "only counts are published",
    ]
    assert {row["method"] for row in text} == {"v", "w", "all", "IN2N", "IG2G", "DGE", "TexGS-VolVis"}
    assert next(row for row in text if row["edit"] != "the paper")["follows"] == "make it gold"


def test_data_sets_with_other_methods_are_added_up_on_their_own():
    entries = rows(user_study(Votes(study("xyz", "xy"), [Ballot("aa", [[1, 2, 3], [1, 2]])])))
    totals = [row["method"] for row in entries if row["data set"] == "all 1"]
    assert totals == ["x", "y", "z", "all", "x", "y", "all"]


def test_without_votes_there_are_those_of_the_paper():
    table = user_study(None)
    assert table.caption.startswith("No votes but the paper's.")
    entries = rows(table)
    assert {row["edit"] for row in entries} == {"the paper"}
    assert [row["kind"] for row in entries] == ["image-driven"] * 21 + ["text-driven"] * 21


def test_the_papers_file_holds_ten_votes_in_each_row_and_column():
    by_dataset = {}
    for line in lines("user_study"):
        by_dataset.setdefault(line["dataset"], []).append(list(line.values())[2:])
    assert len(by_dataset) == 8
    for counts in by_dataset.values():
        for lists in (counts, zip(*counts, strict=True)):
            assert list(map(sum, lists)) == [10] * 4


def test_bars_are_as_long_as_there_are_votes_from_the_best_rank_on():
    (_, ours), (_, theirs) = panels_by_kind(Votes(STUDY, BALLOTS))
    axes = Figure().subplots()
    draw(axes, "image-driven", ours)
    lengths = [[bar.get_width() for bar in bars] for bars in axes.containers]
    assert lengths == [[4, 0, 0], [0, 3, 1], [0, 1, 3]], "by rank, x, y and z each"
    assert [bar.get_x() for bar in axes.containers[2]] == [4, 3, 1], "each begins where the last one ends"
    assert [text.get_text() for text in axes.get_legend().texts] == ["best", "second-best", "worst"]
    assert [label.get_text() for label in axes.get_yticklabels()] == [f"edit_{name}\nquick" for name in "xyz"]
    assert axes.get_title() == "image-driven: 4 rankings of 2 questions"
    axes = Figure().subplots()
    draw(axes, "image-driven", theirs)
    assert [bar.get_width() for bar in axes.containers[0]] == [0, 5, 8, 27]
    assert axes.get_title() == "image-driven, the paper: 40 rankings of 4 questions"


@pytest.mark.parametrize("votes", [Votes(STUDY, BALLOTS), None])
def test_there_is_a_chart_for_each_group(tmp_path, votes):
    assert len(panels_by_kind(votes)) == 2
    path = write_votes(tmp_path / "votes.png", votes)
    with Image.open(path) as picture:
        assert picture.width == 750
        assert picture.height > 400
    assert write_votes(tmp_path / "again.png", votes).read_bytes() == path.read_bytes()
