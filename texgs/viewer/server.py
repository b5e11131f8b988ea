"""The server of a viewer. It answers requests, and has a WebSocket for each open page."""

import asyncio
import secrets
from collections.abc import AsyncIterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch
from aiohttp import WSCloseCode, WSMsgType, web

from texgs.core.errors import ArgumentError
from texgs.core.light import HIDING
from texgs.models.instruction import WORDS
from texgs.scene.scene import Scene
from texgs.scene.session import Session
from texgs.viewer.description import bounds, describe, presets
from texgs.viewer.downloads import exports_of
from texgs.viewer.frames import Beside, Frames
from texgs.viewer.guard import guard, headers
from texgs.viewer.messages import MESSAGE_BYTES, Cancel, Job, Look, Mask, Message, Pick, Save, View, parse
from texgs.viewer.origins import Origins
from texgs.viewer.page import Page
from texgs.viewer.shared_edits import Opened, SharedEdits
from texgs.viewer.slices import Slices
from texgs.viewer.styles import LARGEST_PICTURE
from texgs.viewer.work import Work

WEB = Path(__file__).parent / "web"
SUFFIXES = (".js", ".css", ".svg")
# What changes of a scene that a page knows.
CHANGING_KEYS = (
    *("name", "background", "light", *HIDING, "cuts", "functions"),
    *("markers", "legend", "time", "tfs", "models"),
)
MOST_PAGES = 16
PATIENCE = 2.0  # seconds for a page to close its connection
HEARTBEAT = 20.0  # seconds; a page that is gone is noticed after this time
GOODBYE = b"texgs view has ended. Start it again, and open the address that it prints."


class Server:
    """The state that handlers of requests share. The models of the scene are read at once."""

    def __init__(
        self,
        opened: Opened,
        device: torch.device | str = "cpu",
        styles: Path | None = None,
        session: Session | None = None,
    ) -> None:
        session = session or Session(opened.scene, device)  # shared with whoever edits the scene, too
        composed = session.composition
        self._name = "/".join(opened.source.resolve().parts[-4:])  # of links: scenes may share a title
        self._bounds, self._device = bounds(opened.scene, composed), device
        self._opened = self._latest = (files_of_models(opened.scene), composed)  # models as they were fitted
        self.edits = SharedEdits(session, opened)
        self._origins, self._slices = Origins(opened.scene), Slices(session)
        self._beside = Beside(session, self._origins)
        self.frames = Frames(session, self._beside)
        self._changing = asyncio.Lock()  # changes run in other threads, in turn
        self.work = Work(self.frames, self.edits, self.tell_all, device, styles)
        self._choices = {
            "styles": self.work.styles.names,
            "words": list(WORDS),
            "exports": exports_of(opened.scene),
            "presets": presets(),
        }
        self._pages: dict[Page, web.WebSocketResponse] = {}
        self._count = 0  # of pages so far
        self._run = secrets.token_hex(8)  # by which pages notice another server

    def application(self, token: str, host: str = "127.0.0.1", *, is_framed: bool = False) -> web.Application:
        """Return the application to serve on a host; the token is the first part of every path.

        Other pages, such as notebooks, may show pages that are framed.
        """
        app = web.Application(middlewares=[guard(token, host)], client_max_size=LARGEST_PICTURE)
        handlers = {
            "": self.index,
            "socket": self.socket,
            "still.png": self.still,
            "thumbnail.jpg": self.thumbnail,
            "slice.png": self._slices.picture,
            "place.json": self._slices.place,
            "files/{name}": self.file,
            "{name}": self.module,
        }
        app.router.add_routes([web.get(f"/{token}/{path}", each) for path, each in handlers.items()])
        app.router.add_post(f"/{token}/styles", self.new_style)
        app.on_response_prepare.append(headers(is_framed))
        app.on_shutdown.append(self._say_goodbye)
        app.cleanup_ctx.append(self._closing)
        return app

    async def socket(self, request: web.Request) -> web.StreamResponse:
        """Serve one page until it is gone."""
        socket = web.WebSocketResponse(
            max_msg_size=MESSAGE_BYTES, heartbeat=HEARTBEAT, timeout=PATIENCE, compress=False
        )
        await socket.prepare(request)
        if len(self._pages) >= MOST_PAGES:  # a page never learns why a handshake was refused
            why = f"{MOST_PAGES} pages of this scene are open, which is the most. Close one: this page waits."
            await socket.close(code=WSCloseCode.TRY_AGAIN_LATER, message=why.encode())
            return socket
        self._count += 1
        page = Page(socket, self.edits, self.frames, self.work.find, self._count)
        page.tell_scene({**self.greeting(), "page": page.number})
        self._pages[page] = socket
        sending = [asyncio.create_task(each) for each in (page.send(), page.beat())]
        try:
            await self._listen(socket, page)
        finally:
            del self._pages[page]
            self.work.stop(page)
            for each in sending:
                each.cancel()
            await asyncio.gather(*sending, return_exceptions=True)
        return socket

    async def index(self, request: web.Request) -> web.StreamResponse:
        """Return the page itself."""
        return web.FileResponse(WEB / "page.html")

    async def module(self, request: web.Request) -> web.StreamResponse:
        """Return a module or a style sheet of the page by its name."""
        files = {path.name: path for path in WEB.iterdir() if path.suffix in SUFFIXES}
        path = files.get(request.match_info["name"])
        if path is None:
            raise web.HTTPNotFound
        return web.FileResponse(path)

    async def still(self, request: web.Request) -> web.StreamResponse:
        """Return a PNG file of the view in the query on its page, as `texgs render` writes it."""
        view = parse(request.query.get("view", ""), View)
        scene = self._scene_of(view, request.query.get("page", ""))
        words = await asyncio.to_thread(self.edits.checked, scene)
        png = await self.frames.still(view, scene, words)
        saved = {"Content-Disposition": "attachment"}  # the page gives it a name
        return web.Response(body=png, content_type="image/png", headers=saved)

    async def thumbnail(self, request: web.Request) -> web.StreamResponse:
        """Return a small view of the scene with the look of a picture."""
        asked = parse(request.query.get("look", ""), Look)
        picture = await self.work.thumbnail(replace(asked, preview=True))  # by a quick recipe
        return web.Response(body=picture, content_type="image/jpeg")

    async def new_style(self, request: web.Request) -> web.StreamResponse:
        """Store a picture that the page sends, and return its name."""
        content = await request.read()
        name = await asyncio.to_thread(self.work.styles.add, request.query.get("name", ""), content)
        return web.Response(text=name)

    async def file(self, request: web.Request) -> web.StreamResponse:
        """Return a file that was written for a page."""
        path = self.work.download(request.match_info["name"])
        if path is None:
            raise web.HTTPNotFound
        return web.FileResponse(path)

    async def _listen(self, socket: web.WebSocketResponse, page: Page) -> None:
        """Answer the messages of a page until it is gone."""
        async for received in socket:
            try:
                if received.type != WSMsgType.TEXT:
                    raise ArgumentError("message: expected text, got bytes")
                await self._answer(parse(received.data), page)
            except Exception as error:  # the server survives whatever a page sends
                page.tell_error(error, refused=True)
                page.tell_scene(self.scene_message())  # takes back what it has shown in advance

    async def _answer(self, message: Message, page: Page) -> None:
        """Do what a message asks for, or begin it."""
        if isinstance(message, View):
            page.show(message)
        elif isinstance(message, Pick):
            await page.pick(message)
        elif isinstance(message, Mask) or (isinstance(message, Look) and message.preview):
            page.find(message)
        elif isinstance(message, Job):
            self.work.begin(message, page)
        elif isinstance(message, Cancel):
            if not message.preview:
                self.work.stop(page)
            page.try_on(None)
        else:
            try:
                async with self._changing:
                    if isinstance(message, Save):
                        await self._save(message, page)
                    else:
                        await asyncio.to_thread(self.edits.change, message, page.number)
            finally:
                page.answered += 1
            self.tell_all()

    def tell_all(self) -> None:
        """Tell all pages what the scene is now."""
        news = self.scene_message()
        for each in self._pages:
            each.tell_scene(news)

    async def _save(self, message: Save, page: Page) -> None:
        """Save the scene. The page is asked first where this would replace another file."""
        if not message.replace and self.edits.would_replace(message.name):
            page.tell(f"{message.name} is there already.", level="question", name=message.name)
            return
        path = await asyncio.to_thread(self.edits.save, message.name)
        page.tell(f"Saved as {path}")

    def _scene_of(self, view: View, number: str) -> Scene:
        """Return what a view shows on the page with a number; without one, what all pages share."""
        page = next((page for page in self._pages if str(page.number) == number), None)
        return self.edits.scene_of(view) if page is None else page.scene_of(view)

    def scene_message(self) -> dict[str, Any]:
        """Return the message with the scene's history and what changes about it."""
        scene = self._describe(self.edits.scene)
        changing = {key: scene[key] for key in CHANGING_KEYS}
        return {"type": "scene", "scene": changing, **self.edits.state()}

    def greeting(self) -> dict[str, Any]:
        """Return the first message of a page, with what never changes as well."""
        whole = self._describe(self.edits.scene)
        whole["views"] += self._origins.places
        whole["modes"][1:1] = self._beside.modes
        whole["volume"] = self.edits.scene.volume is not None
        whole["transfer"], whole["slices"] = self._origins.transfer, self._slices.facts
        facts = {"run": self._run, "choices": self._choices, "original": self._describe(self.edits.original)}
        return {**self.scene_message(), "scene": whole, **facts}

    def _describe(self, scene: Scene) -> dict[str, Any]:
        """Return a scene as pages need it. Models are read only where they are new."""
        files = files_of_models(scene)
        if files not in (self._opened[0], self._latest[0]):
            self._latest = (files, scene.as_fitted.open(self._device))
        composed = self._opened[1] if files == self._opened[0] else self._latest[1]
        return describe(self._name, scene, composed, self._bounds)

    async def _say_goodbye(self, app: web.Application) -> None:
        """Close all connections."""
        closing = [each.close(code=WSCloseCode.GOING_AWAY, message=GOODBYE) for each in self._pages.values()]
        await asyncio.gather(*closing)

    async def _closing(self, app: web.Application) -> AsyncIterator[None]:
        """End all threads after the last request."""
        yield
        if self.work.is_at_work:
            print("Waiting for what is being made to stop.", flush=True)
        await asyncio.to_thread(self.work.close)
        self.frames.close()


def files_of_models(scene: Scene) -> list[Path]:
    """Return the files of a scene's models."""
    return [entry.file for entry in scene.models.values()]
