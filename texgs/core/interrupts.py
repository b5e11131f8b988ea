"""Ctrl-C in long work that a notebook goes on after."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from threading import current_thread, main_thread
from types import FrameType

from texgs.core.progress import watched


@contextmanager
def interrupts_between_items() -> Iterator[None]:
    """Let Ctrl-C wait for the next item of a loop that shows its progress, or for the end of the block.

    Elsewhere it may come in the middle of an import, and no process can import the rest of a package that it
    has imported by half. A second Ctrl-C comes at once. Only the main thread gets any.
    """
    before, asked = signal.getsignal(signal.SIGINT), list[int]()
    if not callable(before) or current_thread() is not main_thread():
        yield
        return

    def note(number: int, frame: FrameType | None) -> None:
        asked.append(number)
        if len(asked) > 1:
            before(number, frame)

    def end(*_: object) -> None:
        if asked:
            raise KeyboardInterrupt

    signal.signal(signal.SIGINT, note)
    try:
        with watched(end):
            yield
            end()
    finally:
        signal.signal(signal.SIGINT, before)
