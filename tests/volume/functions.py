"""Transfer functions that tests share."""

from hypothesis import reject
from hypothesis import strategies as st

from texgs.core.errors import ArgumentError
from texgs.volume.transfer import TransferFunction

GREY = ((0, 0.5, 0.5, 0.5),)
TENT = TransferFunction(opacity=((1, 0), (2, 0.8), (4, 0)), color=((1, 1, 0, 0), (4, 0, 0, 1)))
STEPS = TransferFunction(
    opacity=((0, 0.2), (1, 0.4), (1, 0.9), (3, 0.6)), color=((1, 1, 0, 0), (1, 0, 1, 0), (3, 0, 0, 1))
)


@st.composite
def functions(draw):
    """Functions with values on a grid of 1/4 in [-8, 8], so that points, steps and range ends meet."""

    def points(channels, least):
        values = sorted(draw(st.lists(st.integers(-32, 32), min_size=least, max_size=7)))
        values = [value / 4 for i, value in enumerate(values) if i < 2 or value != values[i - 2]]
        unit = st.floats(0, 1, allow_subnormal=False)
        return tuple((value, *(draw(unit) for _ in range(channels))) for value in values)

    opacity, color = points(1, 2), points(3, 1)
    try:
        return TransferFunction(opacity, color)
    except ArgumentError:  # transparent everywhere
        return reject()
