"""A proxy that notes when messages of a WebSocket pass, and may hold what passes for a while."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from urllib.parse import urlsplit

CHUNK = 1 << 16  # bytes
UPGRADE = b"HTTP/1.1 101"


class Arrivals:
    """When messages of at least so many bytes arrived.

    Args:
        least: bytes of a message that counts.
    """

    def __init__(self, least: int) -> None:
        self._least, self._times = least, list[float]()

    def note(self, size: int) -> None:
        """A message of so many bytes is there."""
        if size >= self._least:
            self._times.append(time.perf_counter())

    def since(self, start: float) -> list[float]:
        """Seconds from a moment to each message that came after it."""
        return [each - start for each in list(self._times) if each > start]


class Messages:
    """The messages in what a server sends through a connection, which may be no WebSocket (RFC 6455).

    Args:
        note: is called with the bytes of each message, when its last one is there.
    """

    def __init__(self, note: Callable[[int], None]) -> None:
        self._note, self._waiting, self._size = note, bytearray(), 0
        self._is_socket: bool | None = None  # unknown until the answer to the first request is there

    def feed(self, data: bytes) -> None:
        """Take what has come."""
        if self._is_socket is False:
            return
        self._waiting += data
        if self._is_socket is None:
            head, end, rest = bytes(self._waiting).partition(b"\r\n\r\n")
            if not end:
                return
            self._is_socket, self._waiting = head.startswith(UPGRADE), bytearray(rest)
        while self._is_socket and self._take_frame():
            pass

    def _take_frame(self) -> bool:
        """Whether a whole frame was there; a message has one or more of them."""
        if len(self._waiting) < 2:
            return False
        short = self._waiting[1] & 127
        more = {126: 2, 127: 8}.get(short, 0)
        size = int.from_bytes(self._waiting[2 : 2 + more], "big") if more else short
        if len(self._waiting) < 2 + more + size:
            return False
        is_last, is_control = self._waiting[0] & 128, self._waiting[0] & 8
        del self._waiting[: 2 + more + size]
        if not is_control:
            self._size += size
            if is_last:
                self._note(self._size)
                self._size = 0
        return True


@contextmanager
def proxied(address: str, port: int, arrivals: Arrivals, trip: float = 0.0) -> Iterator[str]:
    """The same address at another port of this machine.

    Args:
        address: of a server.
        port: to listen at.
        arrivals: notes what the server's sockets send, when it leaves the proxy.
        trip: seconds that it takes longer there and back.
    """
    url = urlsplit(address)

    def hold(seconds: float, act: Callable[[bytes], None], data: bytes) -> None:
        loop.call_later(seconds, act, data) if seconds else act(data)

    async def pass_on(reader: asyncio.StreamReader, act: Callable[[bytes], None]) -> None:
        while data := await reader.read(CHUNK):
            hold(trip / 2, act, data)

    async def connect(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        there, back = await asyncio.open_connection(url.hostname, url.port)
        messages = Messages(arrivals.note)

        def answer(data: bytes) -> None:
            writer.write(data)
            messages.feed(data)

        tasks = [asyncio.create_task(each) for each in (pass_on(reader, back.write), pass_on(there, answer))]
        await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        await asyncio.sleep(trip)  # what is held passes first
        for each in (writer, back):
            each.close()
        await asyncio.gather(*tasks, return_exceptions=True)

    async def serve() -> None:
        async with await asyncio.start_server(connect, "127.0.0.1", port):
            is_ready.set()
            await is_over.wait()

    loop, is_ready, is_over = asyncio.new_event_loop(), threading.Event(), asyncio.Event()
    thread = threading.Thread(target=loop.run_until_complete, args=(serve(),), daemon=True)
    thread.start()
    is_ready.wait()
    try:
        yield address.replace(f":{url.port}", f":{port}")
    finally:
        loop.call_soon_threadsafe(is_over.set)
        thread.join()
