"""What a page asks of its server besides its socket: itself, its modules, pictures and files."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path

from aiohttp import web

from texgs.core.errors import TexgsError
from texgs.scene.scene import Scene
from texgs.viewer.frames import Frames
from texgs.viewer.looks import thumbnail
from texgs.viewer.messages import VIEWS, View, parse
from texgs.viewer.shared_edits import SharedEdits
from texgs.viewer.work import Work

WEB = Path(__file__).parent / "web"
SERVED = (".js", ".css", ".svg")


class Requests:
    """Handlers of plain requests; `shown` is what a view shows on the page of a number."""

    def __init__(
        self, edits: SharedEdits, frames: Frames, work: Work, shown: Callable[[View, str], Scene]
    ) -> None:
        self._edits, self._frames, self._work, self._shown = edits, frames, work, shown

    def routes(self, token: str) -> list[web.RouteDef]:
        """Return what is answered, below the token."""
        return [
            web.get(f"/{token}/", self.page),
            web.get(f"/{token}/still.png", self.still),
            web.get(f"/{token}/styles/{{name}}.jpg", self.style),
            web.get(f"/{token}/files/{{name}}", self.file),
            web.post(f"/{token}/styles", self.new_style),
            web.get(f"/{token}/{{name}}", self.module),
        ]

    async def page(self, request: web.Request) -> web.StreamResponse:
        """Return the page itself."""
        return web.FileResponse(WEB / "page.html")

    async def module(self, request: web.Request) -> web.StreamResponse:
        """Return a module or a style sheet of the page, by its name in a list of those that there are."""
        files = {path.name: path for path in WEB.iterdir() if path.suffix in SERVED}
        path = files.get(request.match_info["name"])
        if path is None:
            raise web.HTTPNotFound
        return web.FileResponse(path)

    async def still(self, request: web.Request) -> web.StreamResponse:
        """Return a PNG file of the view in the query on its page, as `texgs render` writes it."""
        try:
            view = parse(request.query.get("view", ""), VIEWS)
            png = await self._frames.still(view, self._shown(view, request.query.get("page", "")))
        except TexgsError as error:
            raise web.HTTPBadRequest(text=str(error)) from error
        saved = {"Content-Disposition": f'attachment; filename="{Path(self._edits.name).stem}.png"'}
        return web.Response(body=png, content_type="image/png", headers=saved)

    async def style(self, request: web.Request) -> web.StreamResponse:
        """Return a small view of a picture that texgs has."""
        try:
            picture = await asyncio.to_thread(thumbnail, request.match_info["name"])
        except TexgsError as error:
            raise web.HTTPNotFound(text=str(error)) from error
        return web.Response(body=picture, content_type="image/jpeg")

    async def new_style(self, request: web.Request) -> web.StreamResponse:
        """Take in a picture of the page's user; return the name that it has from then on."""
        content = await request.read()
        try:
            name = await asyncio.to_thread(self._work.styles.add, request.query.get("name", ""), content)
        except TexgsError as error:
            raise web.HTTPBadRequest(text=str(error)) from error
        return web.Response(text=name)

    async def file(self, request: web.Request) -> web.StreamResponse:
        """Return a file that was written for a page."""
        path = self._work.downloads.file(request.match_info["name"])
        if path is None:
            raise web.HTTPNotFound
        return web.FileResponse(path)
