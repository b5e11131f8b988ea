"""Pages as the server of the viewer sees them, for tests."""

import asyncio
import inspect
import io
import json
import struct
from contextlib import asynccontextmanager
from functools import wraps

import numpy as np
from aiohttp import WSMsgType
from aiohttp.test_utils import TestClient, TestServer
from PIL import Image

from texgs.viewer.server import Server
from texgs.viewer.shared_edits import open_scene

TOKEN = "t" * 43
WAIT = 30  # seconds, on a busy machine


class Browser:
    """A page as the server sees it."""

    def __init__(self, socket):
        self.socket = socket

    async def send(self, **message):
        """Send a message; edits have a title, as pages give them one."""
        if message.get("type") == "edit":
            message = {
                "title": " ".join(str(message.get(key, "")) for key in ("part", "key", "value")).strip()
            } | message
        await self.socket.send_str(json.dumps(message))

    async def next(self, kind):
        """The next message of a kind; a frame is its header and its picture."""
        async with asyncio.timeout(WAIT):
            return await self._next(kind)

    async def _next(self, kind):
        while True:
            message = await self.socket.receive()
            if message.type == WSMsgType.BINARY:
                (length,) = struct.unpack_from("<I", message.data)
                if kind == "frame":
                    picture = Image.open(io.BytesIO(message.data[4 + length :]))
                    return json.loads(message.data[4 : 4 + length]), np.asarray(picture).astype(int)
                continue
            assert message.type == WSMsgType.TEXT, message
            values = json.loads(message.data)
            if values["type"] == kind:
                return values

    async def past(self, *steps):
        """The scene once these steps were made."""
        async with asyncio.timeout(WAIT):
            while (news := await self.next("scene"))["past"] != [*steps]:
                pass
        return news


@asynccontextmanager
async def served(scene_file):
    server = Server(open_scene(scene_file))
    client = TestClient(TestServer(server.application(TOKEN)))
    await client.start_server()
    client.server_side = server
    try:
        yield client
    finally:
        await client.close()


def origin(client):
    return {"Origin": f"http://{client.host}:{client.port}"}


@asynccontextmanager
async def page(client):
    async with client.ws_connect(f"/{TOKEN}/socket", headers=origin(client)) as socket:
        yield Browser(socket)


def on_page(test):
    """Make an asynchronous test one of a page that has got its scene: of `browser`, `client` and fixtures."""
    names = inspect.signature(test).parameters
    kind = inspect.Parameter.POSITIONAL_OR_KEYWORD

    @wraps(test)
    def run(**given):
        async def work():
            async with served(given["scene_file"]) as client, page(client) as browser:
                await browser.next("scene")
                known = {**given, "browser": browser, "client": client}
                await test(**{name: known[name] for name in names})

        asyncio.run(work())

    fixtures = [name for name in {"scene_file": None, **names} if name not in ("browser", "client")]
    run.__signature__ = inspect.Signature([inspect.Parameter(name, kind) for name in fixtures])
    return run
