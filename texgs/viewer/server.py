"""The server of a viewer: the page, its modules, stills, and a WebSocket for each page that is open."""

from __future__ import annotations

import asyncio
import secrets
from collections.abc import AsyncIterator
from functools import partial
from pathlib import Path
from typing import Any

import torch
from aiohttp import WSCloseCode, WSMsgType, web

from texgs.core.errors import ArgumentError, TexgsError
from texgs.core.names import require_name
from texgs.scene.parts import require_new, split
from texgs.scene.scene_file import known
from texgs.scene.session import Session
from texgs.viewer.description import bounds_of, describe
from texgs.viewer.frames import Frames
from texgs.viewer.guard import guard
from texgs.viewer.messages import (
    LARGEST,
    Cancel,
    Edit,
    Mask,
    Message,
    Redo,
    Remove,
    Save,
    Segment,
    Undo,
    View,
    parse,
    view_of,
)
from texgs.viewer.opening import Opened
from texgs.viewer.page import Page
from texgs.viewer.segments import Segmenter
from texgs.viewer.shared_edits import SharedEdits
from texgs.viewer.values import parse_json

Change = Edit | Undo | Redo | Save | Remove
WEB = Path(__file__).parent / "web"
SERVED = (".js", ".css", ".svg")
MOST_PAGES = 16
PATIENCE = 2.0  # seconds for a page to close its connection
HEARTBEAT = 20.0  # seconds, after which a page that is gone is noticed


class Server:
    """What the handlers of requests share. The models of the scene are read at once.

    Args:
        opened: the scene, and where it is saved.
        device: that frames are rendered on.

    Raises:
        ArgumentError, ShapeError: naming the model that cannot be read, and its file.
    """

    def __init__(self, opened: Opened, device: torch.device | str = "cpu") -> None:
        session = Session(opened.scene, device)
        self._title, self._composed = opened.title, session.composition
        self._bounds = bounds_of(self._composed)
        self.edits = SharedEdits(session, opened)
        self.frames = Frames(session)
        self.segmenter = Segmenter(device)
        self._changing = asyncio.Lock()  # a change that reads files takes its time in another thread
        self._job: asyncio.Task[None] | None = None
        self._at_work: Page | None = None  # that the job is for
        self._pages: dict[Page, web.WebSocketResponse] = {}
        self._count = 0  # of pages so far
        self._run = secrets.token_hex(8)  # tells pages that they have met another server

    def application(self, token: str, host: str = "127.0.0.1") -> web.Application:
        """The application to serve.

        Args:
            token: first part of every path.
            host: that it listens on.
        """
        app = web.Application(middlewares=[guard(token, host)], client_max_size=LARGEST)
        app.router.add_get(f"/{token}/", self.page)
        app.router.add_get(f"/{token}/socket", self.socket)
        app.router.add_get(f"/{token}/still.png", self.still)
        app.router.add_get(f"/{token}/{{name}}", self.module)
        app.on_shutdown.append(self._say_goodbye)
        app.cleanup_ctx.append(self._closing)
        return app

    # ---- Requests -----------------------------------------------------------

    async def page(self, request: web.Request) -> web.StreamResponse:
        """The page itself."""
        return web.FileResponse(WEB / "page.html")

    async def module(self, request: web.Request) -> web.StreamResponse:
        """A module or a style sheet of the page, by its name in a list of those that there are."""
        files = {path.name: path for path in WEB.iterdir() if path.suffix in SERVED}
        path = files.get(request.match_info["name"])
        if path is None:
            raise web.HTTPNotFound
        return web.FileResponse(path)

    async def still(self, request: web.Request) -> web.StreamResponse:
        """A PNG file of the view in the query, as `texgs render` writes it."""
        try:
            values = parse_json(request.query.get("view", ""))
            known(values, None, "view")
            view = view_of(values)
            png = await self.frames.still(view, self.edits.shown(view))
        except TexgsError as error:
            raise web.HTTPBadRequest(text=str(error)) from error
        return web.Response(
            body=png,
            content_type="image/png",
            headers={"Content-Disposition": f'attachment; filename="{Path(self.edits.name).stem}.png"'},
        )

    async def socket(self, request: web.Request) -> web.StreamResponse:
        """One page: what it asks for is done until it is gone."""
        if len(self._pages) >= MOST_PAGES:
            raise web.HTTPServiceUnavailable(text=f"expected at most {MOST_PAGES} pages; close one")
        socket = web.WebSocketResponse(
            max_msg_size=LARGEST, heartbeat=HEARTBEAT, timeout=PATIENCE, compress=False
        )
        await socket.prepare(request)
        page = Page(socket, self.edits, self.frames, self.segmenter)
        self._count += 1
        number = self._count
        self._pages[page] = socket
        page.tell_scene(self.scene_message())
        sending = asyncio.create_task(page.send())
        try:
            await self._listen(socket, page, number)
        finally:
            del self._pages[page]
            if self._at_work is page:
                self.segmenter.stop()
            sending.cancel()
            await asyncio.gather(sending, return_exceptions=True)
        return socket

    # ---- Messages -----------------------------------------------------------

    async def _listen(self, socket: web.WebSocketResponse, page: Page, number: int) -> None:
        async for received in socket:
            try:
                if received.type != WSMsgType.TEXT:
                    raise ArgumentError("message: expected text, got bytes")
                await self._answer(parse(received.data), page, number)
            except Exception as error:  # whatever a page sends, the server goes on
                page.tell_error(error)
                page.tell_scene(self.scene_message())  # it shows what it has asked for already

    async def _answer(self, message: Message, page: Page, number: int) -> None:
        if isinstance(message, View):
            page.show(message)
        elif isinstance(message, Mask):
            page.show_mask(message)
        elif isinstance(message, Segment):
            self._begin(message, page)
        elif isinstance(message, Cancel):
            self.segmenter.stop()
        else:
            try:
                async with self._changing:
                    await self._change(message, page, number)
            finally:
                page.answered += 1
            self._tell_all()

    async def _change(self, message: Change, page: Page, number: int) -> None:
        if isinstance(message, Save):
            await self._save(message, page)
        elif isinstance(message, Edit):
            self.edits.edit(message, number)
        elif isinstance(message, Remove):
            self.edits.remove_segment(message.part)
        elif isinstance(message, Undo):
            self.edits.undo()
        elif isinstance(message, Redo):
            self.edits.redo()

    def _tell_all(self) -> None:
        news = self.scene_message()
        for each in self._pages:
            each.tell_scene(news)

    def _begin(self, asked: Segment, page: Page) -> None:
        """Begin to make a segment.

        Raises:
            ArgumentError: if another one is being made, or it cannot have this name.
        """
        if self._job is not None and not self._job.done():
            raise ArgumentError("segment: another one is being made; wait for it, or cancel it")
        require_new(self.edits.scene, asked.part)
        require_name(split(self.edits.scene, asked.part)[1], "segment")
        self._at_work = page
        self._job = asyncio.create_task(self._make_segment(asked, page))

    async def _make_segment(self, asked: Segment, page: Page) -> None:
        page.tell_job(asked.part, 0.0)
        try:
            tell = partial(page.tell_job, asked.part)
            lifted = await self.segmenter.lift(self.edits.scene, asked, tell)
            facts = self.segmenter.facts(asked)
            async with self._changing:
                await asyncio.to_thread(self.edits.make_segment, asked.part, lifted.mask, facts)
            page.tell(f"{asked.part}: {lifted.basis}", level="info")
        except Exception as error:  # whatever it is, the server goes on
            page.tell_error(error)
        page.tell_job(asked.part, None)
        self._at_work = None
        self._tell_all()

    async def _save(self, message: Save, page: Page) -> None:
        """Save the scene; where that would replace another file, the page is asked first."""
        if not message.replace and self.edits.would_replace(message.name):
            page.tell(f"{message.name} is there already.", level="question", name=message.name)
            return
        path = await asyncio.to_thread(self.edits.save, message.name)
        page.tell(f"Saved as {path}", level="info")

    def scene_message(self) -> dict[str, Any]:
        """The scene and its history, for all pages."""
        scene = describe(self._title, self.edits.scene, self._composed, self._bounds)
        return {"type": "scene", "run": self._run, "scene": scene, **self.edits.state()}

    # ---- End ----------------------------------------------------------------

    async def _say_goodbye(self, app: web.Application) -> None:
        sockets = list(self._pages.values())
        await asyncio.gather(*(each.close(code=WSCloseCode.GOING_AWAY) for each in sockets))

    async def _closing(self, app: web.Application) -> AsyncIterator[None]:
        yield
        self.segmenter.close()
        self.frames.close()
