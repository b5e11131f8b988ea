"""The figure of a study."""

import pytest
from matplotlib.figure import Figure
from PIL import Image

from tests.study.test_votes import BALLOTS, STUDY
from texgs.study.ballots import Votes
from texgs.study.votes import compared
from texgs.study.votes_figure import draw, write_votes


def test_bars_are_as_long_as_there_are_votes_from_the_best_rank_on():
    (_, ours), (_, theirs) = compared(Votes(STUDY, BALLOTS))
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


@pytest.mark.parametrize(("votes", "charts"), [(Votes(STUDY, BALLOTS), 2), (None, 2)])
def test_there_is_a_chart_for_each_group(tmp_path, votes, charts):
    assert len(compared(votes)) == charts
    path = write_votes(tmp_path / "votes.png", votes)
    with Image.open(path) as picture:
        assert picture.width == 750
        assert picture.height > 200 * charts
    assert write_votes(tmp_path / "again.png", votes).read_bytes() == path.read_bytes()
