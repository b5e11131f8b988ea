"""Curves of long loops: whoever starts a loop hears of its numbers as they come."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar

Hear = Callable[[Mapping[str, float], int], None]

_hear: ContextVar[Hear | None] = ContextVar("hear", default=None)


@contextmanager
def heard(hear: Hear | None) -> Iterator[None]:
    """Call a function with the points of all curves of this thread within the block.

    Args:
        hear: is called with values by names, and the step of the loop; None: nobody hears. No result depends
            on it.
    """
    before = _hear.set(hear)
    try:
        yield
    finally:
        _hear.reset(before)


def is_heard() -> bool:
    """Return whether anybody hears: else there is no need to measure for curves alone."""
    return _hear.get() is not None


def point(values: Mapping[str, float], step: int) -> None:
    """Tell whoever hears the values of curves at a step."""
    if hear := _hear.get():
        hear(values, step)
