import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from texgs.core.oklab import brightness, chromaticity, from_oklab, oklab

COLORS = torch.rand(500, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(0))


# CSS Color 4 and its tests have these numbers.
@pytest.mark.parametrize(
    ("rgb", "lab"),
    [
        ((1, 1, 1), (1, 0, 0)),
        ((1, 0, 0), (0.62796, 0.22486, 0.12585)),
        ((0, 1, 0), (0.86644, -0.23389, 0.17950)),
        ((0, 0, 1), (0.45201, -0.03246, -0.31153)),
        ((0.5, 0.5, 0.5), (0.59818, 0, 0)),
    ],
)
def test_published_values(rgb, lab):
    assert oklab(torch.tensor(rgb, dtype=torch.float64)).tolist() == pytest.approx(lab, abs=5e-5)


def test_there_and_back():
    torch.testing.assert_close(from_oklab(oklab(COLORS)), COLORS, atol=1e-5, rtol=0)
    assert float(brightness(oklab(COLORS)).max()) <= 1 + 1e-6


def test_gradient():
    some = (0.05 + 0.9 * COLORS[:5]).requires_grad_()
    torch.autograd.gradcheck(oklab, some)
    torch.autograd.gradcheck(lambda x: from_oklab(oklab(x)), some)


@given(st.floats(0.05, 1))
def test_light_leaves_chromaticity_as_it_is(light):
    linear = 0.02 + 0.98 * COLORS
    lit, dim = (
        torch.where(x > 0.0031308, 1.055 * x ** (1 / 2.4) - 0.055, 12.92 * x)
        for x in (linear, light * linear)
    )
    torch.testing.assert_close(chromaticity(dim), chromaticity(lit), atol=1e-4, rtol=0)


def test_a_colour_that_no_screen_shows_gets_darker_and_keeps_its_hue():
    bright = oklab(torch.tensor([0.9, 0.4, 0.2], dtype=torch.float64)) * 1.3
    shown = from_oklab(bright)
    assert float(shown.max()) == pytest.approx(1)
    assert chromaticity(shown).tolist() == pytest.approx((bright[1:] / bright[0]).tolist(), abs=1e-4)
