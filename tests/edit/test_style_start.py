"""Colours that stylising starts from: the map of colours."""

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
    moved = own @ matrix.T + shift
    torch.testing.assert_close(moved.mean(0), style.mean(0), atol=1e-12, rtol=1e-7)
    torch.testing.assert_close(moved.T.cov(correction=0), style.T.cov(correction=0), atol=1e-10, rtol=1e-7)
    own = torch.full((50, 3), 0.4)
    matrix, shift = color_map(own, style)
    expected = style.mean(0).expand(50, 3)
    torch.testing.assert_close(own.double() @ matrix.T + shift, expected, atol=1e-3, rtol=0)


def test_shapes_that_do_not_fit_are_named():
    with pytest.raises(ShapeError, match=r"style: expected \[N, 3\], got \[3, 8\]; did you transpose"):
        color_map(torch.rand(8, 3), torch.rand(3, 8))
