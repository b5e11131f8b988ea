import math

import pytest
import torch
from matplotlib.figure import Figure
from matplotlib.text import Text

from tests.fit.scenes import HEADLIGHT, ball_planes, ball_seeds, cameras
from texgs.core.errors import ArgumentError
from texgs.core.image import write_png
from texgs.fields.surfels.model import Surfels
from texgs.report import fit_figure
from texgs.report.comparison import lines, write_comparison
from texgs.volume.view_set import View

MODELS = {name: Surfels(ball_seeds(seed=seed, opacity=0.9)) for seed, name in enumerate("abcdef")}


@pytest.fixture
def views(tmp_path):
    """The ball from two cameras, cast by rays."""
    named = {}
    for index, camera in enumerate(cameras(2)):
        planes = ball_planes(camera)
        color = planes[:3] - 1 + planes[3]
        path = write_png(tmp_path / f"{index}.png", color.permute(1, 2, 0), planes[3])
        named[f"test view {index}"] = View(camera, path, HEADLIGHT)
    return named


@pytest.fixture
def drawn(monkeypatch):
    """The rows that are drawn, instead of a picture."""
    rows = []
    monkeypatch.setattr(fit_figure, "draw", lambda _path, given, _title: rows.extend(given))
    return rows


def test_each_view_has_a_row_of_fits_and_one_of_their_errors(tmp_path, views, drawn):
    write_comparison(tmp_path / "a.png", {name: MODELS[name] for name in "abc"}, views)
    assert [row.name for row in drawn] == ["test view 0", "errors", "test view 1", "errors"]
    assert [panel.title for panel in drawn[0].cells] == ["ground truth", "a", "b", "c"]
    assert len({panel.words for panel in drawn[0].cells[1:]}) == 3
    (camera, *_), planes = cameras(2), ball_planes(views["test view 0"].camera)
    image = MODELS["b"].render(camera).color.clamp(0, 1)
    error = ((image - planes[:3].permute(1, 2, 0)) ** 2).mean().item()
    of_b = float(drawn[0].cells[2].words.split()[1])
    assert of_b == pytest.approx(-10 * math.log10(error), abs=0.05)  # the views have 8 bits
    assert len({panel.pixels.shape for row in drawn for panel in row.cells if panel.pixels is not None}) == 1


def test_more_recipes_than_a_row_has_room_for_go_on_below(tmp_path, views, drawn):
    write_comparison(tmp_path / "a.png", MODELS, {"view": views["test view 0"]})
    assert [[panel.title for panel in row.cells] for row in drawn[::2]] == [
        ["ground truth", "a", "b", "c"],
        ["ground truth", "d", "e", "f"],
    ]
    assert torch.equal(drawn[0].cells[0].pixels, drawn[2].cells[0].pixels)
    assert [len(line) for line in lines("abcdefg")] == [4, 3]
    assert [len(line) for line in lines("abcdefghi")] == [3, 3, 3]
    assert lines("ab") == ["ab"]


def test_words_do_not_overlap(tmp_path, monkeypatch, views):
    figures = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, _file, **_options: figures.append(figure))
    write_comparison(tmp_path / "a.png", {f"plenoxels_quick{name}": MODELS[name] for name in "abcd"}, views)
    (figure,) = figures
    figure.draw_without_rendering()
    words = [text for text in figure.findobj(Text) if text.get_text() and text.get_visible()]
    boxes = [text.get_window_extent() for text in words]
    for index, box in enumerate(boxes):
        assert figure.bbox.contains(box.x0, box.y0)
        assert figure.bbox.contains(box.x1, box.y1)
        assert not any(box.overlaps(other) for other in boxes[:index]), words[index]


@pytest.mark.parametrize(("models", "shown"), [({}, {"a": None}), (MODELS, {})])
def test_nothing_to_compare_is_one_sentence(tmp_path, models, shown):
    with pytest.raises(ArgumentError, match="expected models and views, got"):
        write_comparison(tmp_path / "a.png", models, shown)
