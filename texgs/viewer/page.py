"""One connected page: its requests, and the messages that wait for it."""

import asyncio
import json
import logging
from collections import deque
from collections.abc import Awaitable, Callable, Mapping
from ctypes import c_int32
from typing import Any

from aiohttp import web

from texgs.core.errors import Stopped, TexgsError, first_line
from texgs.scene.parts import NewLook
from texgs.scene.scene import Scene
from texgs.viewer.frames import Frames, Pace
from texgs.viewer.messages import Look, Mask, Pick, View
from texgs.viewer.shared_edits import SharedEdits

log = logging.getLogger("texgs.viewer")
MOST_NOTICES = 8  # may wait for a page that does not listen
BEAT = 5.0  # seconds; a page takes its connection for broken after a few silent ones
Find = Callable[[Mask | Look], Awaitable[Any]]  # what clicks select as a message, or a `TriedLook`


class Page:
    """The messages that wait for a page, of views and scenes only the newest. Its number is its own."""

    def __init__(
        self, socket: web.WebSocketResponse, edits: SharedEdits, frames: Frames, found: Find, number: int
    ) -> None:
        self.number = number
        self._socket, self._edits, self._frames, self._found = socket, edits, frames, found
        self._notices: deque[dict[str, Any]] = deque(maxlen=MOST_NOTICES)
        self._news: dict[str, dict[str, Any]] = {}  # the newest message of each type
        self._view: View | None = None
        self._asked: dict[type[Mask | Look], Mask | Look] = {}  # the newest of each type
        self._finding: dict[type[Mask | Look], asyncio.Task[None]] = {}
        self._tried: Look | None = None  # the newest preview, until it is taken off
        self._trial: dict[str, NewLook] = {}
        self._shown_looks = deque[Any](maxlen=2)  # keeps their files, for frames on their way
        self._paces: dict[str, Pace] = {}  # by mode
        self._stop = c_int32()  # stops the whole frame that is being rendered
        self.answered = 0  # count of messages that change the scene
        self._wake = asyncio.Event()

    def show(self, view: View) -> None:
        """Send a frame of this view, in place of one that waits and of a whole one that is being rendered."""
        self._view, self._stop.value = view, 1
        self._wake.set()

    async def pick(self, asked: Pick) -> None:
        """Send the point that a pixel shows."""
        point = await self._frames.point_at(asked.view, self.scene_of(asked.view), asked.pixel)
        self._tell_newest({"type": "point", "id": asked.id, "point": point})

    def find(self, asked: Mask | Look) -> None:
        """Send what clicks select, or show a preview of a look, in place of what was asked for before."""
        self._asked[type(asked)] = asked
        if isinstance(asked, Look):
            self._tried = asked
        self._wake.set()

    def tell_job(self, title: str, done: float | None, failed: bool = False) -> None:
        """Send the part of a job that is done. None: it has ended or failed."""
        self._tell_newest({"type": "job", "title": title, "done": done, "failed": failed})

    def tell_scene(self, message: dict[str, Any]) -> None:
        """Send news of the scene, merged into those that wait."""
        before = self._news.get("scene", {"scene": {}})
        self._tell_newest({**before, **message, "scene": {**before["scene"], **message["scene"]}})

    def try_on(self, looks: Mapping[str, NewLook] | None) -> None:
        """Show more parts with new looks, on this page alone. None: take all of them off."""
        if looks is None:
            self._tried = None
        self._trial = {} if looks is None else {**self._trial, **looks}
        self._tell_newest({"type": "trial", "parts": list(self._trial)})

    def tell(self, text: str, level: str = "info", **more: Any) -> None:
        """Send a notice."""
        self._notices.append({"type": "notice", "text": text, "level": level, **more})
        self._wake.set()

    def tell_error(self, error: Exception, **more: Any) -> None:
        """Send an error. One that is no mistake of the user is logged with its traceback as well."""
        if not isinstance(error, TexgsError):
            log.error("%s", error, exc_info=error)
        text = str(error) if isinstance(error, TexgsError) else f"internal error: {first_line(error)}"
        self.tell(text, level="info" if isinstance(error, Stopped) else "error", **more)

    async def send(self) -> None:
        """Send what waits, until the page is gone. One frame is on its way at a time."""
        try:
            while not self._socket.closed:
                await self._wake.wait()
                self._wake.clear()
                await self._send_what_waits()
        finally:
            self._stop.value = 1
            for task in self._finding.values():
                task.cancel()

    async def beat(self) -> None:
        """Send a sign of life until the page is gone: its script cannot see pings."""
        while True:
            await asyncio.sleep(BEAT)
            await self._socket.send_str('{"type": "beat"}')

    async def _send_what_waits(self) -> None:
        """Send notices, news and the frame; masks and previews are found meanwhile."""
        while self._notices:
            await self._socket.send_str(json.dumps(self._notices.popleft()))
        news, self._news = self._news, {}
        for message in news.values():
            await self._socket.send_str(json.dumps(message))
        for kind in [*self._asked]:
            if kind not in self._finding or self._finding[kind].done():
                self._finding[kind] = asyncio.create_task(self._find(self._asked.pop(kind)))
        if self._view is not None:
            view, self._view = self._view, None
            await self._send_frame(view)

    def scene_of(self, view: View) -> Scene:
        """Return what a view shows on this page."""
        return self._edits.scene_of(view, self._trial)

    def _tell_newest(self, message: dict[str, Any]) -> None:
        """Send a message in place of one of its type that waits."""
        self._news.pop(message["type"], None)  # the new one goes to the end of the queue
        self._news[message["type"]] = {**message, "answered": self.answered}
        self._wake.set()

    async def _send_frame(self, view: View) -> None:
        """Render a view and send it; a whole one is given up when a newer view comes meanwhile."""
        stop = c_int32()
        if not view.moving:
            self._stop = stop
        try:
            frame = await self._frames.frame(view, self.scene_of(view), self._paces, stop)
        except Stopped:
            return
        except Exception as error:  # the server survives it
            self.tell_error(error, frame=view.id)
            return
        await self._socket.send_bytes(frame)

    async def _find(self, asked: Mask | Look) -> None:
        """Find a mask or a look and send it. Frames go on meanwhile: another page may come first."""
        try:
            found = await self._found(asked)
            if isinstance(asked, Mask):
                self._tell_newest(found)
            elif asked is self._tried:
                self._shown_looks.append(found)
                self._trial = {}  # parts of the last preview may not be chosen any more
                self.try_on(found.looks)
        except Exception as error:  # the server survives it
            self.tell_error(error, **({"mask": asked.id} if isinstance(asked, Mask) else {}))
        finally:
            self._wake.set()  # for the next one that waits
