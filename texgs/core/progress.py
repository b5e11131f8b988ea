"""Progress of a long loop: a bar on a terminal or lines in a log file, its curves, Ctrl-C between items."""

import signal
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from contextvars import ContextVar
from importlib.util import find_spec
from io import StringIO
from operator import length_hint
from threading import current_thread, main_thread
from time import monotonic
from types import FrameType
from typing import Any, TypeVar

T = TypeVar("T")

Watch = Callable[[str, int, int | None], None]
LogPoint = Callable[[Mapping[str, float], int], None]

SECONDS_BETWEEN_LINES = 5.0
LINE = r": \d+(?: of \d+)? \w+, [\d.]+ (?:\w+/s|s/\w+)(?:, [\w ]+)?$"  # how lines of a log end
_watch: ContextVar[Watch | None] = ContextVar("watch", default=None)
_log: ContextVar[LogPoint | None] = ContextVar("log", default=None)


@contextmanager
def _within(variable: ContextVar[T], value: T) -> Iterator[None]:
    """Give a variable of this thread a value within the block."""
    before = variable.set(value)
    try:
        yield
    finally:
        variable.reset(before)


def watching(watch: Watch) -> AbstractContextManager[None]:
    """Call a function for each item that a loop of this thread has done within the block.

    It gets the title of the loop, the number of items done and their total, where that is known. What it
    raises ends the loop.
    """
    return _within(_watch, watch)


def let_stop(title: str) -> None:
    """Let who watches the loops of this thread end the work here, before it changes what others see."""
    if watch := _watch.get():
        watch(title, 0, None)


def curve_logger(log: LogPoint | None) -> AbstractContextManager[None]:
    """Call a function with the points of all curves of this thread within the block; None: nobody is told.

    It gets values by names, and the step of the loop. No result depends on it.
    """
    return _within(_log, log)


def has_curve_logger() -> bool:
    """Return whether points are wanted: else there is no need to measure for curves alone."""
    return _log.get() is not None


def log_point(values: Mapping[str, float], step: int) -> None:
    """Pass the values of curves at a step to the logger, where there is one."""
    if log := _log.get():
        log(values, step)


def progress(iterable: Iterable[T], total: int | None = None, *, title: str, unit: str) -> Iterator[T]:
    """Yield the items of a loop; report on stderr how many are done, how fast, and the time left.

    A terminal or a notebook shows one moving bar. Anything else, such as the log file of a job, gets a plain
    line at most every second, later every five, and one at the end, also where the loop was left early; none
    where there is nothing to do. The rates of these lines are means since the start. The unit names one item,
    such as "view".

    Example:
        >>> list(progress("ab", title="letters", unit="letter"))
        ['a', 'b']
    """
    if total is None:
        total = length_hint(iterable) or None
    watch = _watch.get()
    for done, item in enumerate(_shown(iterable, total, title, unit), start=1):
        yield item
        if watch is not None:
            watch(title, done, total)


def _shown(iterable: Iterable[T], total: int | None, title: str, unit: str) -> Iterable[T]:
    """Return the items, in a bar or with plain lines."""
    is_notebook = "ipykernel.kernelapp" in sys.modules  # others talk to kernels
    if not (is_notebook or sys.stderr.isatty()):
        return _lines(iterable, total, title, unit)
    look: dict[str, Any] = {"dynamic_ncols": True}
    if not is_notebook:
        from tqdm import tqdm  # slow to import
    elif find_spec("ipywidgets"):
        from tqdm.notebook import tqdm
    else:
        tqdm, look = cell_bar(), {"file": StringIO()}
    if is_notebook:  # a cell keeps no long list
        look |= {"leave": False}
    bar: Iterable[T] = tqdm(iterable, desc=title, total=total, unit=unit, **look)
    return bar


def cell_bar() -> Any:
    """Return a bar for notebooks without widgets: one output of a cell, which changes, also in files."""
    from IPython.display import DisplayHandle
    from tqdm import tqdm

    class Bar(tqdm):  # type: ignore[misc]
        """Shows its line in a place of its own, where others print one below the other."""

        cell: Any = None  # of `display`

        def display(self, msg: str | None = None, pos: int | None = None) -> None:
            line = {"text/plain": str(self) if msg is None else msg}
            if self.cell is None:
                self.cell = DisplayHandle()  # type: ignore[no-untyped-call]
                self.cell.display(line, raw=True)
            else:
                self.cell.update(line, raw=True)

    return Bar


def _lines(iterable: Iterable[T], total: int | None, title: str, unit: str) -> Iterator[T]:
    """Yield the items and write the plain lines."""
    start = last = monotonic()
    done, outcome = 0, "stopped after"
    try:
        for item in iterable:
            yield item
            done += 1
            now = monotonic()
            if now - last >= min(SECONDS_BETWEEN_LINES, max(1, (now - start) / 4)) and done != total:
                left = f", {time_text((total - done) * (now - start) / done)} left" if total else ""
                print(f"{title}: {_state(done, total, unit, now - start)}{left}", file=sys.stderr, flush=True)
                last = now
        outcome = "took"
    finally:
        seconds = monotonic() - start
        if done or outcome != "took":  # else there was nothing to do
            state = f"{_state(done, total, unit, seconds)}, {outcome} {time_text(seconds)}"
            print(f"{title}: {state}", file=sys.stderr, flush=True)


def _state(done: int, total: int | None, unit: str, seconds: float) -> str:
    """Return count and rate, such as "40 of 92 views, 5.1 view/s"; a rate below one is inverted."""
    units = unit if (total or done) == 1 else f"{unit}s"
    count = f"{done} of {total} {units}" if total else f"{done} {units}"
    if not done or seconds <= 0:
        return count
    rate = done / seconds
    return f"{count}, {rate:.1f} {unit}/s" if rate >= 1 else f"{count}, {1 / rate:.1f} s/{unit}"


def time_text(seconds: float) -> str:
    """Return a time in its two largest units: "10 s", "3 min 05 s", "2 h 07 min"."""
    whole = round(max(seconds, 0))
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60:02d} s"
    return f"{whole // 3600} h {whole % 3600 // 60:02d} min"


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
        with watching(end):
            yield
            end()
    finally:
        signal.signal(signal.SIGINT, before)
