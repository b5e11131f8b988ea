"""One page that is connected: what it asks for, and what it is told."""

import asyncio
import json
import logging
from collections import deque
from collections.abc import Awaitable, Callable, Mapping
from typing import Any

from aiohttp import web

from texgs.core.errors import TexgsError, first_line
from texgs.scene.parts import NewLook
from texgs.scene.scene import Scene
from texgs.viewer.frames import Frames, Pace
from texgs.viewer.messages import Look, Mask, Pick, View
from texgs.viewer.shared_edits import SharedEdits

log = logging.getLogger("texgs.viewer")
MOST_NOTICES = 8  # that wait for a page which does not listen
BEAT = 5.0  # seconds; a page that hears nothing for some of these takes its connection for broken
Find = Callable[[Mask | Look], Awaitable[Any]]  # what clicks select as a message, or a `TriedLook`


class Stopped(TexgsError):
    """Somebody has asked to stop."""


class Page:
    """What waits to be sent to a page; of views and scenes only the newest. No two have the same number."""

    def __init__(
        self, socket: web.WebSocketResponse, edits: SharedEdits, frames: Frames, found: Find, number: int
    ) -> None:
        self.number = number
        self._socket, self._edits, self._frames, self._found = socket, edits, frames, found
        self._notices: deque[dict[str, Any]] = deque(maxlen=MOST_NOTICES)
        self._news: dict[str, dict[str, Any]] = {}  # by type, of each the newest
        self._view: View | None = None
        self._asked: dict[type[Mask | Look], Mask | Look] = {}  # by type, of each the newest that waits
        self._finding: dict[type[Mask | Look], asyncio.Task[None]] = {}
        self._tried: Look | None = None  # the newest preview, until it is taken off
        self._trial: dict[str, NewLook] = {}
        self._shown_looks = deque[Any](maxlen=2)  # whose files stay: a frame of the last may be on its way
        self._pace = Pace()
        self.answered = 0  # messages that change the scene
        self._wake = asyncio.Event()

    def show(self, view: View) -> None:
        """Send a frame of this view, in place of one that waits."""
        self._view = view
        self._wake.set()

    async def pick(self, asked: Pick) -> None:
        """Send which point a pixel shows."""
        point = await self._frames.point_at(asked.view, self.shown(asked.view), asked.pixel)
        self._tell_newest({"type": "point", "point": point})

    def find(self, asked: Mask | Look) -> None:
        """Send what clicks select, or show a preview of a look, in place of what was asked for before."""
        self._asked[type(asked)] = asked
        if isinstance(asked, Look):
            self._tried = asked
        self._wake.set()

    def tell_job(self, title: str, done: float | None, failed: bool = False) -> None:
        """Send how far a job is, in place of what waits; None: it has ended, and may have failed."""
        self._tell_newest({"type": "job", "title": title, "done": done, "failed": failed})

    def tell_scene(self, message: dict[str, Any]) -> None:
        """Send what the scene is now, in place of what waits; of that stays what the message does not say."""
        before = self._news.get("scene", {"scene": {}})
        self._tell_newest({**before, **message, "scene": {**before["scene"], **message["scene"]}})

    def try_on(self, looks: Mapping[str, NewLook] | None) -> None:
        """Show parts with new looks on this page alone, beside those before; None: as all pages do."""
        if looks is None:
            self._tried = None
        self._trial = {} if looks is None else {**self._trial, **looks}
        self._tell_newest({"type": "trial", "parts": list(self._trial)})

    def tell(self, text: str, level: str = "info", **more: Any) -> None:
        """Send a notice."""
        self._notices.append({"type": "notice", "text": text, "level": level, **more})
        self._wake.set()

    def tell_error(self, error: Exception, **more: Any) -> None:
        """Send what went wrong; what is no mistake of the user is logged here with its place as well."""
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
            for task in self._finding.values():
                task.cancel()

    async def beat(self) -> None:
        """Send a word again and again until the page is gone: its script cannot see pings."""
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

    def shown(self, view: View) -> Scene:
        """Return what a view shows on this page."""
        return self._edits.shown(view, self._trial)

    def _tell_newest(self, message: dict[str, Any]) -> None:
        """Send a message in place of one of its type that waits."""
        self._news.pop(message["type"], None)  # the new one goes behind what others wait
        self._news[message["type"]] = {**message, "answered": self.answered}
        self._wake.set()

    async def _send_frame(self, view: View) -> None:
        """Render a view and send it."""
        try:
            frame = await self._frames.frame(view, self.shown(view), self._pace)
        except Exception as error:  # whatever it is, the server goes on
            self.tell_error(error, frame=view.id)
            return
        await self._socket.send_bytes(frame)

    async def _find(self, asked: Mask | Look) -> None:
        """Find what was asked for: it may have to wait for another page, while frames go on."""
        try:
            found = await self._found(asked)
            if isinstance(asked, Mask):
                self._tell_newest(found)
            elif asked is self._tried:
                self._shown_looks.append(found)
                self._trial = {}  # of parts that are no longer chosen
                self.try_on(found.looks)
        except Exception as error:  # whatever it is, the server goes on
            self.tell_error(error, **({"mask": asked.id} if isinstance(asked, Mask) else {}))
        finally:
            self._wake.set()  # another may wait
