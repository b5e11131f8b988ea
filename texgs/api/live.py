"""The viewer of a scene that Python edits as well, for a notebook on the same machine."""

import asyncio
import secrets
import threading
from pathlib import Path

from aiohttp import web

from texgs.core.errors import ArgumentError
from texgs.core.names import SCENE
from texgs.scene.session import Session
from texgs.viewer.server import Server
from texgs.viewer.shared_edits import Opened

HOST = "127.0.0.1"
PATIENCE = 60.0  # seconds for the server to start


class Viewer:
    """Serves the pages of a session in a thread, until the process ends.

    Args:
        session: that pages and Python edit.
        folder: for files of looks and segments that pages make. What they save goes to the current folder,
            with copies of these.

    Raises:
        ArgumentError: if nothing can be served on this machine.
    """

    def __init__(self, session: Session, folder: Path) -> None:
        title = ", ".join(session.scene.models)
        opened = Opened(session.scene, folder / SCENE, folder, SCENE, title=title, copies=Path.cwd())
        self._server = Server(opened, session.composition.device, session=session)
        self._loop, self._token = asyncio.new_event_loop(), secrets.token_urlsafe(32)
        threading.Thread(target=self._loop.run_forever, name="texgs viewer", daemon=True).start()
        serving = asyncio.run_coroutine_threadsafe(self._serve(), self._loop)
        try:
            self.address = serving.result(PATIENCE)
        except OSError as error:  # a TimeoutError is one
            self._loop.call_soon_threadsafe(self._loop.stop)
            raise ArgumentError(
                f"{HOST}: cannot listen there ({error.strerror or 'it takes too long'})"
            ) from error
        session.changed = self._tell

    def _tell(self) -> None:
        """Tell all pages what the scene is now."""
        self._loop.call_soon_threadsafe(self._server.tell_all)

    async def _serve(self) -> str:
        """Start to serve, and return the address."""
        runner = web.AppRunner(self._server.application(self._token, HOST, is_framed=True), access_log=None)
        await runner.setup()
        site = web.TCPSite(runner, HOST, 0)
        await site.start()
        port = runner.addresses[0][1]
        return f"http://{HOST}:{port}/{self._token}/"
