"""A thread beside that of the server, for what takes longer than a frame."""

import asyncio
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import TypeVar

import torch

from texgs.core.errors import TexgsError
from texgs.core.progress import watched

T = TypeVar("T")


class Stopped(TexgsError):
    """Somebody has asked to stop."""


@dataclass(frozen=True)
class Watch:
    """Who is told about a job, and whether it has to stop."""

    tell: Callable[[str, float], None] = lambda title, done: None  # what is done, and the part of it
    stop: threading.Event = field(default_factory=threading.Event)


class Jobs:
    """A thread that works with half of the threads of the machine, as a rule: the others are for frames."""

    def __init__(self) -> None:
        self._all = torch.get_num_threads()
        self._thread = ThreadPoolExecutor(1, "job")

    async def run(self, work: Callable[[], T], watch: Watch, *, is_urgent: bool = False) -> T:
        """Return what work returns; who watches it is told in this thread about the loops in the other.

        Urgent work has all threads: somebody waits for it, and frames may be slower meanwhile.
        """
        loop, threads = asyncio.get_running_loop(), self._all if is_urgent else max(1, self._all // 2)

        def step(title: str, done: int, total: int | None) -> None:
            if watch.stop.is_set():
                raise Stopped(f"{title}: it was cancelled; nothing has changed.")
            if total:
                loop.call_soon_threadsafe(watch.tell, title, done / total)

        def watched_work() -> T:
            torch.set_num_threads(threads)
            with watched(step):
                result = work()
            if watch.stop.is_set():  # after the last step, or there was none
                raise Stopped("It was cancelled; nothing has changed.")
            return result

        return await loop.run_in_executor(self._thread, watched_work)

    def close(self) -> None:
        """End the thread, once what it does has ended."""
        self._thread.shutdown(wait=True, cancel_futures=True)
