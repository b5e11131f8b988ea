"""The share of what views show that a model shows: of parts that are missing, not of what is fainter."""

import pytest
import torch

from texgs.metrics.quality import compare, shown_share, what_is_lost
from texgs.raster import Render


def view(*parts, size=40):
    """Alpha of rectangles, each with its opacity: rows, columns, alpha."""
    alpha = torch.zeros(size, size)
    for rows, columns, value in parts:
        alpha[rows, columns] = value
    return alpha


LARGE, ROD, SPECK = (slice(0, 20), slice(0, 30), 0.8), (slice(30, 31), slice(0, 40), 0.5), (35, 35, 1.0)


def test_a_piece_that_is_missing_counts_by_its_alpha():
    whole = view(LARGE, ROD, SPECK)
    assert shown_share(view(LARGE, ROD, SPECK), whole) == 1
    total = 600 * 0.8 + 40 * 0.5 + 1
    assert shown_share(view(LARGE, SPECK), whole) == pytest.approx(1 - 20 / total)
    assert shown_share(view(ROD), whole) == pytest.approx(20 / total)
    assert shown_share(torch.zeros(40, 40), whole) == 0
    assert shown_share(view(LARGE), torch.zeros(40, 40)) is None


def test_what_is_fainter_or_thicker_everywhere_is_not_missing():
    whole, noise = view(LARGE, ROD), torch.rand(40, 40, generator=torch.Generator().manual_seed(0))
    assert shown_share(whole * (0.6 + 0.8 * noise), whole) == 1
    dust = (noise > 0.5).float()
    assert shown_share(torch.full((40, 40), 0.5), dust) > 0.999, "finer than pixels"
    assert shown_share(0.49 * whole, whole) == 0


def test_scores_have_it_and_less_is_told():
    color, whole = torch.ones(40, 40, 3), view(LARGE, ROD, SPECK)
    scores = compare(Render(color, view(LARGE, SPECK)), Render(color, whole))
    assert scores["shown"] == pytest.approx(1 - 20 / 501)
    assert "the model shows 96.0 % of what test views show, so that parts" in what_is_lost(scores["shown"])
    assert what_is_lost(0.995) == what_is_lost(None) == ""
    assert "shown" not in compare(Render(color, whole), Render(color, torch.zeros(40, 40)))
