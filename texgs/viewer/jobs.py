"""What takes longer than a frame: one job after the other, in a thread of their own."""

from __future__ import annotations

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


def ignore(title: str, done: float) -> None:
    """Do nothing: nobody watches."""


@dataclass(frozen=True)
class Watch:
    """Who is told about a job, and whether it has to stop."""

    tell: Callable[[str, float], None] = ignore  # what is being done, and the part of it that is done
    stop: threading.Event = field(default_factory=threading.Event)


class Jobs:
    """A thread that works with half of the threads of the machine: the others are for frames."""

    def __init__(self) -> None:
        half = max(1, torch.get_num_threads() // 2)
        self._thread = ThreadPoolExecutor(1, "job", torch.set_num_threads, (half,))

    async def run(self, work: Callable[[], T], watch: Watch) -> T:
        """Return what work returns; who watches it is told in this thread about the loops in the other."""
        loop = asyncio.get_running_loop()

        def step(title: str, done: int, total: int | None) -> None:
            if watch.stop.is_set():
                raise Stopped(f"{title}: it was cancelled; nothing has changed.")
            if total:
                loop.call_soon_threadsafe(watch.tell, title, done / total)

        def watched_work() -> T:
            with watched(step):
                result = work()
            if watch.stop.is_set():  # after the last step, or there was none
                raise Stopped("It was cancelled; nothing has changed.")
            return result

        return await loop.run_in_executor(self._thread, watched_work)

    def close(self) -> None:
        """End the thread, once what it does has ended."""
        self._thread.shutdown(wait=True, cancel_futures=True)
