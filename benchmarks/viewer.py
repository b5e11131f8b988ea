"""Frames a second and delays of `texgs view` in a browser that drags, beside viser with the same frames.

`python -m benchmarks.viewer SCENE OUTPUT.json` needs Playwright, a Chromium, and viser in the environment,
see benchmarks/viser_viewer.py. The viewers take turns. Frames are counted in a proxy before the browser: a
page may have its socket in a worker. `texgs view` is measured a second time behind 100 ms of round trip. The
browser runs on the same cores, without a GPU: the page of viser then needs WebGL in software, that of texgs
needs none. A client without a page is measured too: what it gets, a browser elsewhere can show.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median, quantiles
from typing import Any

import torch

from benchmarks import machine
from benchmarks.command import call
from benchmarks.viewer_client import turned
from benchmarks.websocket_proxy import Arrivals, proxied
from tests.viewer.browser import SOFTWARE, browser
from texgs.scene.scene_file import read_scene

PLAIN = ("--disable-gpu",)  # of a browser whose page needs no WebGL
PAGE = 800  # pixels of either side of the picture
PANEL = 310  # pixels beside it, of the page of texgs
DRAG, STEPS = 5.0, 40  # seconds of a drag, and single moves
LEAST = 2048  # bytes of a message that is a frame: small ones of a moving camera have some 3,500
ROUNDS = 3
PORT, TRIP = 8790, 0.1  # and seconds of a round trip


def main(source: str, output: str) -> None:
    """Measure all viewers; write the file."""
    rows: dict[str, list[dict[str, float]]] = {}
    with texgs(source) as ours, viser(source) as other:
        viewers = {
            "texgs view": (ours, PANEL, 0.0, PLAIN),
            "texgs view, 100 ms round trip": (ours, PANEL, TRIP, PLAIN),
            "viser": (other, 0, 0.0, SOFTWARE),
        }
        for _ in range(ROUNDS):
            rows.setdefault("texgs view, no browser", []).append(turned(ours, PAGE, DRAG))
            for name, (address, panel, trip, args) in viewers.items():
                arrivals = Arrivals(LEAST)
                with browser(args) as chromium, proxied(address, PORT + 2, arrivals, trip) as near:
                    rows.setdefault(name, []).append(measured(chromium, near, panel, arrivals))
    facts = {
        "machine": machine.describe(torch.device("cpu")),
        "primitives": len(read_scene(source).open()),
        "size": PAGE,
    }
    Path(output).write_text(json.dumps({**facts, "rounds": rows}, indent=1) + "\n")
    for name, rounds in rows.items():
        medians = {key: round(median(each[key] for each in rounds), 1) for key in rounds[0]}
        print(name, medians)


def measured(chromium: Any, address: str, panel: int, arrivals: Arrivals) -> dict[str, float]:
    """Frames a second of a drag, and milliseconds from a move to the next frame and to the last one."""
    page = chromium.new_page(viewport={"width": PAGE + panel, "height": PAGE + (44 if panel else 0)})
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
    if not first:
        raise SystemExit(f"{address}: no frame came after {STEPS} moves of the pointer")
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


if __name__ == "__main__":
    call(main)
