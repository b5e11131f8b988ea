"""Work that takes a while: one job at a time, with previews and thumbnails beside it."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from time import monotonic
from typing import Any, TypeVar

import torch

from texgs.config.kept_function import keep
from texgs.core.errors import ArgumentError, Stopped
from texgs.core.progress import let_stop, watching
from texgs.edit.function_model import FIRST_MODEL, fit_function, overlap_of
from texgs.scene.parts import NewLook
from texgs.scene.scene import Scene
from texgs.viewer.downloads import write_download
from texgs.viewer.frames import Frames
from texgs.viewer.looks import Looks
from texgs.viewer.messages import Export, Fit, Job, Keep, Look, Mask, Segment
from texgs.viewer.page import Page
from texgs.viewer.segments import Segmenter
from texgs.viewer.shared_edits import SharedEdits
from texgs.viewer.styles import Styles

T = TypeVar("T")
Call = Callable[..., object]


class Jobs:
    """A worker that uses half of the threads of the machine, as a rule: the others are for frames."""

    def __init__(self) -> None:
        self._all = torch.get_num_threads()
        self._thread = ThreadPoolExecutor(1, "job")

    async def run(
        self,
        work: Callable[[], T],
        tell: Callable[[str, float], object] = lambda title, done: None,
        stop: threading.Event | None = None,
        *,
        is_urgent: bool = False,
    ) -> T:
        """Return what work returns.

        Args:
            work: runs in the other thread.
            tell: is called in this thread with the title of a loop of the work, and the part that is done.
            stop: ends the work at the next step of a loop, by `Stopped`.
            is_urgent: whether it has all threads: somebody waits for it, and frames may be slower meanwhile.
        """
        loop, threads = asyncio.get_running_loop(), self._all if is_urgent else max(1, self._all // 2)

        def step(title: str, done: int, total: int | None) -> None:
            if stop is not None and stop.is_set():
                raise Stopped(f"{title}: it was cancelled; nothing has changed.")
            if total:
                loop.call_soon_threadsafe(tell, title, done / total)

        def watched_work() -> T:
            torch.set_num_threads(threads)
            with watching(step):
                return work()

        return await loop.run_in_executor(self._thread, watched_work)

    def close(self) -> None:
        """End the thread when its work is done."""
        self._thread.shutdown(wait=True, cancel_futures=True)


class Work:
    """Does one job at a time. A job edits the shared scene, and calls `changed` when it has."""

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
        self._scratch = TemporaryDirectory(prefix="texgs-")
        folder = Path(self._scratch.name)
        self.styles = Styles(folder / "styles", styles)
        self._segmenter, self._looks = Segmenter(device), Looks(self.styles, folder / "looks", device)
        self._frames, self._downloads = frames, folder / "downloads"
        self._downloads.mkdir()
        self._task: asyncio.Task[None] | None = None
        self._page: Page | None = None  # of the job
        self._stop = threading.Event()

    async def find(self, asked: Mask | Look) -> Any:
        """Return the message of a mask, which waits for a job; or a tried look, beside jobs."""
        scene = self._edits.scene
        if isinstance(asked, Mask):
            return await self._jobs.run(partial(self._segmenter.mask, scene, asked))
        return await self._previews.run(partial(self._looks.tried, scene, asked), is_urgent=True)

    async def thumbnail(self, asked: Look) -> bytes:
        """Return a small picture of the scene with a look, when earlier ones are done."""
        return await self._thumbnails.run(partial(self._looks.thumbnail, self._edits.scene, asked))

    def download(self, name: str) -> Path | None:
        """Return the file of a name that was written for a page to save, if there is one."""
        return next((path for path in self._downloads.iterdir() if path.name == name), None)

    def begin(self, asked: Job, page: Page) -> None:
        """Begin a job of a page, unless another one is at work."""
        if self.is_at_work:
            of = " for another page: wait for it" if page is not self._page else ": wait for it, or cancel it"
            raise ArgumentError(f"a job is at work already{of}")
        self._page, self._stop = page, threading.Event()
        self._task = asyncio.create_task(self._work(asked, page, self._stop))

    @property
    def is_at_work(self) -> bool:
        """Return whether a job is at work."""
        return self._task is not None and not self._task.done()

    def stop(self, page: Page | None = None) -> None:
        """Stop the job that is at work; where a page is given, only a job of this page."""
        if page is None or page is self._page:
            self._stop.set()

    def close(self) -> None:
        """Stop the job, end the threads, and remove files that nobody has saved."""
        self.stop()
        for jobs in (self._jobs, self._previews, self._thumbnails):
            jobs.close()
        self._scratch.cleanup()

    async def _work(self, asked: Job, page: Page, stop: threading.Event) -> None:
        """Do a job, and tell its page when it begins, ends or fails."""
        loop = asyncio.get_running_loop()
        page.tell_job("", 0.0)
        failed = False
        try:
            work = partial(self._do, asked, page, loop.call_soon_threadsafe)
            notice = await self._jobs.run(work, page.tell_job, stop, is_urgent=isinstance(asked, Fit))
            page.tell(**notice)
        except Exception as error:  # the server survives it
            page.tell_error(error)
            failed = True
        self._page = None
        self._changed()
        page.tell_job("", None, failed)

    def _tell_changed(self, page: Page, text: str) -> None:
        """Send all pages the scene in the middle of a job, and a notice to the job's page."""
        self._changed()
        page.tell(text)

    # ---- Jobs, in their thread: `call` calls functions of the page in its own -----------------

    def _do(self, asked: Job, page: Page, call: Call) -> dict[str, str]:
        """Do a job, and return the notice for its page."""
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
                return {"level": "file", **self._export(asked, page.scene_of(asked.view))}

    def _look(
        self, asked: Look, output: Path, try_on: Callable[[Mapping[str, NewLook] | None], object]
    ) -> str:
        """Give parts of the scene a look, which the page tries on meanwhile, and say how."""
        start = monotonic()
        try:
            given = self._looks.give(self._edits.session, asked, output, lambda *look: try_on(dict([look])))
        finally:
            try_on(None)
        left = f" Not in the scene any more: {', '.join(given.gone)}." if given.gone else ""
        done = f"{asked.style or asked.instruction}: {given.how}, {monotonic() - start:.0f} s."
        return f"{done}{left} Textures are in {output}; the scene is not saved yet."

    def _fit(self, name: str, tell: Callable[[str], object]) -> str:
        """Replace a function by a first model, say so, and do the same with a finer one."""
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
        """Write a file of a scene, and return the notice about it."""
        edits = self._edits
        name, checked = Path(edits.name).stem, edits.checked(scene)
        known = name, edits.title, checked
        path, notes = write_download(self._downloads, scene, asked, *known, self._frames.pixels)
        let_stop(path.name)
        words = ", ".join([f"{path.stat().st_size / 2**20:.1f} MiB", *notes])
        return {"text": f"{path.name}: {words}", "name": path.name}
