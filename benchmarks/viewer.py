"""Frames a second and delays of `texgs view` in a browser that drags, beside viser with the same frames.

`python -m benchmarks.viewer SCENE OUTPUT.json` needs Playwright, a Chromium, and viser in the environment,
see benchmarks/viser_viewer.py. The viewers take turns. Frames are counted where they arrive, in the WebSocket
of the page. `texgs view` is measured a second time behind 100 ms of round trip.
"""

from __future__ import annotations

import asyncio
import json
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median, quantiles
from typing import Any
from urllib.parse import urlsplit

import torch

from benchmarks import machine
from tests.viewer.browser import browser
from texgs.scene.scene_file import read_scene

PAGE = 800  # pixels of either side of the picture
PANEL = 310  # pixels beside it, of the page of texgs
DRAG, STEPS = 5.0, 40  # seconds of a drag, and single moves
LEAST = 4096  # bytes of a message that is a frame
ROUNDS = 3
PORT, TRIP = 8790, 0.1  # and seconds of a round trip


class Arrivals:
    """When frames arrive in the sockets of a page."""

    def __init__(self, page: Any) -> None:
        self.times: list[float] = []
        page.on("websocket", lambda socket: socket.on("framereceived", self._note))

    def _note(self, payload: bytes | str) -> None:
        if isinstance(payload, bytes) and len(payload) >= LEAST:
            self.times.append(time.perf_counter())

    def since(self, start: float) -> list[float]:
        """Seconds from a moment to each frame that came after it."""
        return [each - start for each in self.times if each > start]


def main(source: str, output: str) -> None:
    """Measure all viewers; write the file."""
    rows: dict[str, list[dict[str, float]]] = {}
    with browser() as chromium, texgs(source) as address, viser(source) as other, delayed(address) as far:
        for _ in range(ROUNDS):
            rows.setdefault("texgs view", []).append(measured(chromium, address, PANEL))
            rows.setdefault("texgs view, 100 ms round trip", []).append(measured(chromium, far, PANEL))
            rows.setdefault("viser", []).append(measured(chromium, other, 0))
    facts = {
        "machine": machine.describe(torch.device("cpu")),
        "primitives": len(read_scene(source).open()),
        "size": PAGE,
    }
    Path(output).write_text(json.dumps({**facts, "rounds": rows}, indent=1) + "\n")
    for name, rounds in rows.items():
        medians = {key: round(median(each[key] for each in rounds), 1) for key in rounds[0]}
        print(name, medians)


def measured(chromium: Any, address: str, panel: int) -> dict[str, float]:
    """Frames a second of a drag, and milliseconds from a move to the next frame and to the last one."""
    page = chromium.new_page(viewport={"width": PAGE + panel, "height": PAGE + (44 if panel else 0)})
    arrivals = Arrivals(page)
    page.goto(address)
    page.wait_for_timeout(5000)
    page.mouse.move(PAGE / 2, PAGE / 2)
    page.mouse.down()
    start, x = time.perf_counter(), PAGE / 2
    while time.perf_counter() - start < DRAG:
        x = PAGE / 2 + (7 * (x - PAGE / 2 + 1)) % 200
        page.mouse.move(x, PAGE / 2)
        page.wait_for_timeout(8)
    frames = len(arrivals.since(start))
    first, last = [], []
    for step in range(STEPS):
        page.wait_for_timeout(400)
        moved = time.perf_counter()
        page.mouse.move(PAGE / 2 + 3 * step, PAGE / 2 + 2 * step)
        page.wait_for_timeout(600)
        if later := arrivals.since(moved):
            first.append(1000 * later[0])
            last.append(1000 * later[-1])
    page.mouse.up()
    page.close()
    return {
        "frames_per_second": frames / DRAG,
        "first_ms": median(first),
        "first_ms_95": quantiles(first, n=20)[-1],
        "last_ms": median(last),
        "answered": len(first),
    }


@contextmanager
def texgs(source: str) -> Iterator[str]:
    """Its viewer, and the address."""
    words = [sys.executable, "-m", "texgs.cli.main", "view", source, "--no-browser", "--port", str(PORT)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            yield process.stdout.readline().strip()
        finally:
            process.terminate()


@contextmanager
def viser(source: str) -> Iterator[str]:
    """That of viser."""
    port = PORT + 1
    with subprocess.Popen([sys.executable, "-m", "benchmarks.viser_viewer", source, str(port)]) as process:
        try:
            time.sleep(10)
            yield f"http://127.0.0.1:{port}"
        finally:
            process.terminate()


@contextmanager
def delayed(address: str) -> Iterator[str]:
    """The same address behind a proxy that holds what passes for half of a round trip, both ways."""
    url, port = urlsplit(address), PORT + 2
    loop = asyncio.new_event_loop()

    async def pass_on(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        while data := await reader.read(1 << 16):
            loop.call_later(TRIP / 2, writer.write, data)
        loop.call_later(TRIP / 2, writer.close)

    async def connect(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        there, back = await asyncio.open_connection(url.hostname, url.port)
        await asyncio.gather(pass_on(reader, back), pass_on(there, writer), return_exceptions=True)

    async def serve() -> None:
        async with await asyncio.start_server(connect, "127.0.0.1", port) as server:
            await server.serve_forever()

    threading.Thread(target=loop.run_until_complete, args=(serve(),), daemon=True).start()
    time.sleep(1)
    yield address.replace(f":{url.port}/", f":{port}/")


if __name__ == "__main__":
    main(*sys.argv[1:])
