"""What pages ask for that takes a while: one job at a time, with previews and thumbnails beside it."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from time import monotonic
from typing import Any, TypeVar

import torch

from texgs.config.kept_function import keep
from texgs.core.errors import ArgumentError
from texgs.core.progress import let_stop, watching
from texgs.edit.function_model import FIRST_MODEL, fit_function, overlap_of
from texgs.scene.parts import NewLook
from texgs.scene.scene import Scene
from texgs.viewer.downloads import Downloads
from texgs.viewer.frames import Frames
from texgs.viewer.looks import Looks
from texgs.viewer.messages import Export, Fit, Keep, Look, Mask, Segment
from texgs.viewer.page import Page, Stopped
from texgs.viewer.scratch import scratch_folder
from texgs.viewer.segments import Segmenter
from texgs.viewer.shared_edits import SharedEdits
from texgs.viewer.styles import Styles

T = TypeVar("T")
Job = Segment | Look | Fit | Keep | Export
Call = Callable[..., object]


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
            with watching(step):
                return work()

        return await loop.run_in_executor(self._thread, watched_work)

    def close(self) -> None:
        """End the thread, once what it does has ended."""
        self._thread.shutdown(wait=True, cancel_futures=True)


class Work:
    """Does one job at a time, which edits the shared scene; `changed` is called whenever one has."""

    def __init__(
        self,
        frames: Frames,
        edits: SharedEdits,
        changed: Callable[[], None],
        device: torch.device | str,
        styles: Path | None = None,
    ) -> None:
        self._edits, self._changed, self._device = edits, changed, device
        self._jobs, self._previews, self._thumbnails = Jobs(), Jobs(), Jobs()  # side by side
        self._scratch = scratch_folder()
        folder = Path(self._scratch.name)
        self.styles = Styles(folder / "styles", styles)
        self._segmenter, self._looks = Segmenter(device), Looks(self.styles, folder / "looks", device)
        self.downloads = Downloads(frames, edits, folder / "downloads")
        self._task: asyncio.Task[None] | None = None
        self._page: Page | None = None  # that it is for
        self._stop = threading.Event()

    async def find(self, asked: Mask | Look) -> Any:
        """Return what clicks select, as a message, after a job of another page; or a look, beside jobs."""
        scene = self._edits.scene
        if isinstance(asked, Mask):
            return await self._jobs.run(partial(self._segmenter.mask, scene, asked), Watch())
        return await self._previews.run(partial(self._looks.tried, scene, asked), Watch(), is_urgent=True)

    async def thumbnail(self, asked: Look) -> bytes:
        """Return a small picture of the scene with a look, after those that were asked for before."""
        return await self._thumbnails.run(partial(self._looks.thumbnail, self._edits.scene, asked), Watch())

    def begin(self, asked: Job, page: Page) -> None:
        """Begin to make or write something for a page, unless another job is at work."""
        if self.is_at_work:
            of = " for another page: wait for it" if page is not self._page else ": wait for it, or cancel it"
            raise ArgumentError(f"a job is at work already{of}")
        self._page, self._stop = page, threading.Event()
        self._task = asyncio.create_task(self._work(asked, page, Watch(page.tell_job, self._stop)))

    @property
    def is_at_work(self) -> bool:
        """Return whether something is being made."""
        return self._task is not None and not self._task.done()

    def stop(self, page: Page | None = None) -> None:
        """Stop the job that is at work, if there is one, and it is for this page or whichever."""
        if page is None or page is self._page:
            self._stop.set()

    def close(self) -> None:
        """Stop, end the threads, and remove files that nobody has saved."""
        self.stop()
        for jobs in (self._jobs, self._previews, self._thumbnails):
            jobs.close()
        self._scratch.cleanup()

    async def _work(self, asked: Job, page: Page, watch: Watch) -> None:
        """Do a job, and tell its page when it begins, fails and ends."""
        loop = asyncio.get_running_loop()
        page.tell_job("", 0.0)
        failed = False
        try:
            work = partial(self._do, asked, page, loop.call_soon_threadsafe)
            notice = await self._jobs.run(work, watch, is_urgent=isinstance(asked, Fit))
            page.tell(**notice)
        except Exception as error:  # whatever it is, the server goes on
            page.tell_error(error)
            failed = True
        self._page = None
        self._changed()
        page.tell_job("", None, failed)

    def _tell_changed(self, page: Page, text: str) -> None:
        """Tell all pages of the scene while a job goes on, and the page that it is for what it has done."""
        self._changed()
        page.tell(text)

    # ---- Jobs, in their thread: `call` calls functions of the page in its own -----------------

    def _do(self, asked: Job, page: Page, call: Call) -> dict[str, str]:
        """Do a job, and return what there is to tell its page in the end."""
        match asked:
            case Segment():
                file = partial(self._edits.new_file, "segment", asked.part)
                lifted = self._segmenter.segment(self._edits.session, asked, file)
                return {"text": f"{asked.part}: {lifted.basis}"}
            case Look():
                output = self._edits.new_folder("image" if asked.style else "text")
                return {"text": self._look(asked, output, partial(call, page.try_on))}
            case Fit():
                return {"text": self._fit(asked.function, partial(call, self._tell_changed, page))}
            case Keep():
                return {"text": keep(self._edits.scene, asked.function)}
            case Export():
                return {"level": "file", **self._export(asked, page.shown(asked.view))}

    def _look(
        self, asked: Look, output: Path, try_on: Callable[[Mapping[str, NewLook] | None], object]
    ) -> str:
        """Give parts of the scene a look that a page tries on meanwhile; return what was done."""
        start = monotonic()
        try:
            given = self._looks.give(self._edits.session, asked, output, lambda *look: try_on(dict([look])))
        finally:
            try_on(None)
        left = f" Not in the scene any more: {', '.join(given.gone)}." if given.gone else ""
        done = f"{asked.style or asked.instruction}: {given.how}, {monotonic() - start:.0f} s."
        return f"{done}{left} Textures are in {output}; the scene is not saved yet."

    def _fit(self, name: str, tell: Callable[[str], object]) -> str:
        """Put a first model in the place of a function, and tell it; return the same of the finer model."""
        edits, start, done = self._edits, monotonic(), ""
        models = fit_function(edits.session, name, partial(edits.new_file, "model", name), self._device)
        try:
            for made in models:
                more = overlap_of(edits.scene, name) if made == FIRST_MODEL else ""
                done = f"{name}: {made}, {monotonic() - start:.0f} s; the scene is not saved yet.{more}"
                if made == FIRST_MODEL:
                    tell(done)
        except Stopped as stopped:
            if done:
                raise Stopped(f"{name}: the finer model was cancelled; the first one stays.") from stopped
            raise
        return done

    def _export(self, asked: Export, scene: Scene) -> dict[str, str]:
        """Write a file of a scene; return its name, and what there is to say of it."""
        path, notes = self.downloads.write(scene, asked, Path(self._edits.name).stem)
        let_stop(path.name)
        words = ", ".join([f"{path.stat().st_size / 2**20:.1f} MiB", *notes])
        return {"text": f"{path.name}: {words}", "name": path.name}
