"""OKLab beside published values and another library, and the law that light leaves chromaticity."""

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from texgs.core.oklab import brightness, chromaticity, from_oklab, oklab

# CSS Color Module Level 4, sample values of OKLab.
PUBLISHED = {
    (1.0, 0.0, 0.0): (0.62796, 0.22486, 0.12585),
    (0.0, 1.0, 0.0): (0.86644, -0.23389, 0.17950),
    (0.0, 0.0, 1.0): (0.45201, -0.03246, -0.31153),
    (1.0, 1.0, 1.0): (1.0, 0.0, 0.0),
    (0.0, 0.0, 0.0): (0.0, 0.0, 0.0),
}
XYZ = (
    (0.4124564, 0.3575761, 0.1804375),
    (0.2126729, 0.7151522, 0.0721750),
    (0.0193339, 0.1191920, 0.9503041),
)
CHANNEL = st.floats(0.03125, 1)
COLOR = st.tuples(CHANNEL, CHANNEL, CHANNEL)


def decoded(rgb):
    """Linear values of sRGB (IEC 61966-2-1)."""
    return torch.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)


def encoded(linear):
    """SRGB of linear values."""
    return torch.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def test_published_values():
    colors, expected = (torch.tensor([*each]) for each in (PUBLISHED, PUBLISHED.values()))
    torch.testing.assert_close(oklab(colors), expected, atol=2e-3, rtol=0)
    torch.testing.assert_close(oklab(colors)[:4], expected[:4], atol=1e-5, rtol=1e-4)


@given(COLOR)
def test_another_library_turns_it_back(rgb):
    color4 = pytest.importorskip("tinycss2.color4")
    lightness, a, b = oklab(torch.tensor(rgb, dtype=torch.float64)).tolist()
    xyz = color4.parse_color(f"oklab({lightness:.9f} {a:.9f} {b:.9f})").to("xyz-d65")
    expected = torch.tensor(XYZ, dtype=torch.float64) @ decoded(torch.tensor(rgb, dtype=torch.float64))
    torch.testing.assert_close(torch.tensor([*xyz][:3], dtype=torch.float64), expected, atol=1e-3, rtol=0)


@given(COLOR, st.floats(0.05, 1))
def test_light_scales_linear_colours_and_leaves_chromaticity(rgb, light):
    color = torch.tensor(rgb, dtype=torch.float64)
    torch.testing.assert_close(
        chromaticity(encoded(light * decoded(color))), chromaticity(color), atol=1e-6, rtol=1e-6
    )


def test_slopes_are_finite_down_to_black():
    colors = torch.tensor([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.04045, 0.5, 1.0]], requires_grad=True)
    (oklab(colors).sum() + chromaticity(colors).sum()).backward()
    assert torch.isfinite(colors.grad).all()
    assert chromaticity(torch.zeros(3)).abs().max() < 1e-5


@given(COLOR)
def test_there_and_back(rgb):
    color = torch.tensor(rgb, dtype=torch.float64)
    torch.testing.assert_close(from_oklab(oklab(color)), color, atol=1e-5, rtol=0)
    assert float(brightness(oklab(color))) == pytest.approx(float(decoded(color).max()), abs=1e-6)


def test_a_colour_that_no_screen_shows_gets_darker_and_keeps_its_hue():
    bright = oklab(torch.tensor([0.9, 0.4, 0.2], dtype=torch.float64)) * 1.3
    shown = from_oklab(bright)
    assert float(shown.max()) == pytest.approx(1)
    assert chromaticity(shown).tolist() == pytest.approx((bright[1:] / bright[0]).tolist(), abs=1e-4)
