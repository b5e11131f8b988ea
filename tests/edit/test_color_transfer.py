import numpy as np
import pytest
import torch

from texgs.core.errors import ShapeError
from texgs.edit.style_start import color_map


def colors(seed, count, spread):
    """Correlated colours around a mean."""
    rng = np.random.default_rng(seed)
    return torch.from_numpy(rng.normal(size=(count, 3)) @ rng.normal(size=(3, 3)) * spread + rng.random(3))


def test_mean_and_covariance_become_those_of_the_style():
    own, style = colors(0, 500, 0.1), colors(1, 900, 0.3)
    matrix, shift = color_map(own, style)
    moved = (own @ matrix.T + shift).numpy()
    np.testing.assert_allclose(moved.mean(0), style.numpy().mean(0), atol=1e-12)
    expected = np.cov(style.numpy().T, bias=True)
    np.testing.assert_allclose(np.cov(moved.T, bias=True), expected, atol=1e-10)


def test_colours_that_are_so_already_stay():
    own = colors(2, 100, 0.2)
    matrix, shift = color_map(own, own)
    torch.testing.assert_close(matrix, torch.eye(3, dtype=torch.float64))
    assert shift.abs().max() < 1e-12


def test_one_colour_becomes_the_mean_of_the_style():
    style = colors(3, 100, 0.2)
    own = torch.full((50, 3), 0.4)
    matrix, shift = color_map(own, style)
    torch.testing.assert_close(
        own.double() @ matrix.T + shift, style.mean(0).expand(50, 3), atol=1e-3, rtol=0
    )


def test_colours_are_rows_of_three():
    with pytest.raises(ShapeError, match=r"style: expected \[N, 3\], got \[3, 8\]; did you transpose"):
        color_map(torch.rand(8, 3), torch.rand(3, 8))
