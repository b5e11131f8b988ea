"""What pages ask for that takes a while: one job at a time, with previews and thumbnails beside it."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Awaitable, Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from time import monotonic
from typing import Any, TypeVar

import torch

from texgs.config.kept_function import keep
from texgs.core.errors import ArgumentError, located
from texgs.core.names import part_file, require_name
from texgs.core.progress import watched
from texgs.edit.function_model import models_of, overlap_of, tried
from texgs.fields.surfels.model import Surfels
from texgs.scene.parts import NewLook, entry_of, require_new, split
from texgs.viewer.downloads import Downloads, require_kind
from texgs.viewer.frames import Frames
from texgs.viewer.looks import Looks, looks_of, with_parts
from texgs.viewer.messages import Export, Fit, Keep, Look, Mask, Segment
from texgs.viewer.page import Page, Stopped
from texgs.viewer.segments import Segmenter
from texgs.viewer.shared_edits import SharedEdits
from texgs.viewer.styles import Styles

T = TypeVar("T")


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


class Work:
    """Does one job at a time, which adds to edits; `changing` is held meanwhile, then `changed` called."""

    def __init__(
        self,
        frames: Frames,
        edits: SharedEdits,
        changing: asyncio.Lock,
        changed: Callable[[], None],
        device: torch.device | str,
        styles: Path | None = None,
    ) -> None:
        self._edits, self._changing, self._changed = edits, changing, changed
        self._device = device
        self._jobs, self._previews, self._thumbnails = Jobs(), Jobs(), Jobs()  # side by side
        self.styles = Styles(styles)
        self._segmenter, self._looks = Segmenter(device), Looks(self.styles, device)
        self.downloads = Downloads(frames, edits)
        self._task: asyncio.Task[None] | None = None
        self._page: Page | None = None  # that it is for
        self._stop = threading.Event()

    async def find(self, asked: Mask | Look, page: int) -> Any:
        """Return what clicks select, as a message, after a job of another page; or a preview, beside jobs."""
        scene = self._edits.scene
        if isinstance(asked, Mask):
            return await self._jobs.run(partial(self._segmenter.mask, scene, asked), Watch())
        work = partial(self._looks.preview, scene, asked, page)
        return await self._previews.run(work, Watch(), is_urgent=True)

    async def thumbnail(self, asked: Look) -> bytes:
        """Return a small picture of the scene with a look, after those that were asked for before."""
        return await self._thumbnails.run(partial(self._looks.thumbnail, self._edits.scene, asked), Watch())

    async def begin(self, asked: Segment | Look | Fit | Keep | Export, page: Page) -> None:
        """Begin to make or write something; what is wrong with it is told first."""
        scene = self._edits.scene
        match asked:
            case Segment():
                require_new(scene, asked.part)
                name = split(scene, asked.part)[1]
                require_name(name, "segment")
                part_file("segment", str(name))
                job = partial(self._segment, asked, page)
            case Look():
                for part in asked.parts:
                    entry_of(scene, part)
                edit = await asyncio.to_thread(self._looks.edit_of, asked)  # reads its picture
                job = partial(self._look, asked, edit, page)
            case Fit():
                tried(scene, asked.function)
                require_name(asked.function, "function")
                job = partial(self._fit, asked, page)
            case Keep():
                job = partial(self._keep, asked, page)
            case Export():
                require_kind(scene, asked.kind)
                job = partial(self._export, asked, page)
        self._begin(page, job)

    @property
    def is_at_work(self) -> bool:
        """Return whether something is being made."""
        return self._task is not None and not self._task.done()

    def forget(self, page: Page) -> None:
        """Stop the job of a page that is gone, and remove its previews."""
        self.stop(page)
        self._looks.forget(page.number)

    def stop(self, page: Page | None = None) -> None:
        """Stop the job that is at work, if there is one, and it is for this page or whichever."""
        if page is None or page is self._page:
            self._stop.set()

    def close(self) -> None:
        """Stop, and end the thread."""
        self.stop()
        for jobs in (self._jobs, self._previews, self._thumbnails):
            jobs.close()
        self._looks.close()
        self.downloads.close()
        self.styles.close()

    def _begin(self, page: Page, job: Callable[[Watch], Awaitable[None]]) -> None:
        """Begin a job for a page, unless another one is at work."""
        if self.is_at_work:
            of = " for another page: wait for it" if page is not self._page else ": wait for it, or cancel it"
            raise ArgumentError(f"a job is at work already{of}")
        self._page, self._stop = page, threading.Event()
        self._task = asyncio.create_task(self._work(page, job, Watch(page.tell_job, self._stop)))

    async def _work(self, page: Page, job: Callable[[Watch], Awaitable[None]], watch: Watch) -> None:
        """Do a job, and tell its page when it begins, fails and ends."""
        page.tell_job("", 0.0)
        failed = False
        try:
            await job(watch)
        except Exception as error:  # whatever it is, the server goes on
            page.tell_error(error)
            failed = True
        self._page = None
        self._changed()
        page.tell_job("", None, failed)

    async def _segment(self, asked: Segment, page: Page, watch: Watch) -> None:
        """Make a segment, and tell its page on how many views it rests."""
        lifted = await self._jobs.run(partial(self._segmenter.lift, self._edits.scene, asked), watch)
        facts = self._segmenter.facts(asked)
        async with self._changing:
            await asyncio.to_thread(self._edits.make_segment, asked.part, lifted.mask, facts)
        page.tell(f"{asked.part}: {lifted.basis}", level="info")

    async def _look(self, asked: Look, edit: Any, page: Page, watch: Watch) -> None:
        """Show textures on their way on the page that asked, then give them to the scene."""
        scene, loop = self._edits.scene, asyncio.get_running_loop()
        name, output = asked.style or asked.instruction, self._edits.new_folder(edit.name)
        edit = await asyncio.to_thread(with_parts, edit, scene)

        def show(part: str, look: NewLook) -> None:
            loop.call_soon_threadsafe(page.try_on, {part: look})

        start = monotonic()
        try:
            edited = await self._jobs.run(partial(self._looks.make, scene, edit, output, show), watch)
            looks = looks_of(edited.scene, edit.parts, scene)
            with located(f"textures are in {output}"):
                async with self._changing:
                    gone = await asyncio.to_thread(self._edits.give_looks, looks, name)
        finally:
            page.try_on(None)
        how = f"{name}: {edited.how}, {monotonic() - start:.0f} s."
        left = f" Not in the scene any more: {', '.join(gone)}." if gone else ""
        page.tell(f"{how}{left} Textures are in {output}; the scene is not saved yet.", level="info")

    async def _fit(self, asked: Fit, page: Page, watch: Watch) -> None:
        """Put a first model in the place of its function, and then a finer one in the place of that."""
        scene, name, edits = self._edits.scene, asked.function, self._edits
        tf, start, loop = tried(scene, name), monotonic(), asyncio.get_running_loop()
        given: list[Path] = []  # files of the first model and of the finer one

        async def give(model: Surfels) -> None:
            before = given[0] if given else None
            async with self._changing:
                file = await asyncio.to_thread(edits.give_model, name, model, tf, before)
            if file is None:
                was = "first model" if given else "function"
                raise ArgumentError(f"{name}: its {was} was changed meanwhile; make the model again")
            self._changed()
            what, more = ("finer model", "") if given else ("model", overlap_of(edits.scene, name))
            took = f"{monotonic() - start:.0f} s; the scene is not saved yet."
            page.tell(f"{name}: {what}, {took}{more}", level="info")
            given.append(file)

        def work() -> None:
            for model in models_of(scene, name, self._device):
                asyncio.run_coroutine_threadsafe(give(model), loop).result()

        try:
            await self._jobs.run(work, watch, is_urgent=True)
        except Stopped as stopped:
            if given:
                raise Stopped(f"{name}: the finer model was cancelled; the first one stays.") from stopped
            raise

    async def _keep(self, asked: Keep, page: Page, watch: Watch) -> None:
        """Write a function into the file of its data set, and tell its page what that means."""
        kept = partial(keep, self._edits.scene, asked.function)
        page.tell(await self._jobs.run(kept, watch), level="info")

    async def _export(self, asked: Export, page: Page, watch: Watch) -> None:
        """Write a file, and tell its page where it is."""
        scene, name = page.shown(asked.view), Path(self._edits.name).stem
        path, notes = await self._jobs.run(partial(self.downloads.write, scene, asked, name), watch)
        told = ", ".join([f"{path.stat().st_size / 2**20:.1f} MiB", *notes])
        page.tell(f"{path.name}: {told}", level="file", name=path.name)
