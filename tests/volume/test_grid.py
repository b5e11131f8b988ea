import numpy as np
import pytest

from texgs.core.errors import ArgumentError, ShapeError
from texgs.volume.grid import Grid


def test_longest_side_is_one_and_the_box_is_centred():
    # Sides are (n - 1) * spacing: 2, 12, 3.
    grid = Grid(np.zeros((7, 5, 3)), (1.0, 3.0, 0.5), (100.0, -3.0, 0.0))
    assert grid.dims == (3, 5, 7)
    assert grid.scale == pytest.approx(1 / 12)
    low, high = grid.aabb
    assert low == pytest.approx((-1 / 12, -0.5, -1 / 8))
    assert high == pytest.approx((1 / 12, 0.5, 1 / 8))


@pytest.mark.parametrize(
    ("values", "spacing", "message"),
    [
        (np.zeros((2, 2)), (1, 1, 1), r"expected a scalar field \[Z, Y, X\], got the shape \[2, 2\]"),
        (np.zeros((2, 5, 6, 3)), (1, 1, 1), "3 components per sample"),
        (np.zeros((2, 5, 1)), (1, 1, 1), r"at least 2 samples along x, y and z, got \[1, 5, 2\]"),
        (np.zeros((2, 2, 2)), (1, 0, 1), r"above 0, got \[1, 0, 1\]; set it right"),
        (np.zeros((2, 2, 2)), (1, 1, float("inf")), "three finite numbers above 0"),
        (np.zeros((2, 2, 2)), (1, 1), "three finite numbers above 0"),
        (np.zeros((2, 2, 2), complex), (1, 1, 1), "expected integers, floats or bool, got complex128"),
    ],
)
def test_mistakes_are_named(values, spacing, message):
    with pytest.raises((ArgumentError, ShapeError), match=message):
        Grid(values, spacing)
    with pytest.raises(ArgumentError, match="origin: expected three finite numbers"):
        Grid(np.zeros((2, 2, 2)), (1, 1, 1), (0, float("nan"), 0))
