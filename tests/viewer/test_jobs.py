"""The thread for what takes longer than a frame."""

import asyncio
import threading

import pytest
import torch

from texgs.core.errors import Stopped
from texgs.core.progress import progress
from texgs.viewer.work import Jobs


def run(work, *watch):
    async def both():
        jobs = Jobs()
        try:
            return await jobs.run(work, *watch)
        finally:
            jobs.close()

    return asyncio.run(both())


def test_it_tells_how_far_loops_are():
    told = []

    def work():
        return sum(progress([1, 2, 3, 4], title="numbers", unit="number"))

    assert run(work, lambda *news: told.append(news)) == 10
    assert told == [("numbers", 0.25), ("numbers", 0.5), ("numbers", 0.75), ("numbers", 1.0)]


def test_it_stops_after_the_step_that_it_is_at():
    stop, done = threading.Event(), []

    def work():
        for item in progress("abc", title="letters", unit="letter"):
            done.append(item)
            stop.set()

    with pytest.raises(Stopped, match="letters: it was cancelled; nothing has changed"):
        run(work, print, stop)
    assert done == ["a"]


def test_it_leaves_half_of_the_threads_to_frames():
    before = torch.get_num_threads()
    assert run(torch.get_num_threads) == max(1, before // 2)
    assert torch.get_num_threads() == before
