"""Frames a second and delays of `texgs view`, by a client that moves something and shows nothing.

`python -m benchmarks.viewer SCENE OUTPUT.json [CASE...]` starts the viewer and asks for frames as fast as
they come. A case is a mode in which the scene turns, such as `shaded` (default), `volume`, `difference` or
`wipe`; or `function`, which drags the first transfer function of the volume.
What the client gets is what a browser on another machine can show: none runs on the same cores.
"""

import asyncio
import json
import time
from itertools import count
from pathlib import Path
from statistics import median, quantiles
from typing import Any
from urllib.parse import urlsplit

import aiohttp
import psutil
import torch

from benchmarks import machine
from benchmarks.browser import viewer
from benchmarks.command import call
from texgs.scene.scene_file import read_scene

SIZE, SECONDS, ROUNDS = 800, 5.0, 3  # pixels of either side, seconds of a round, and rounds
WARM = 10  # frames before those that count: the resolution has settled then


def main(source: str, output: str, *cases: str) -> None:
    """Measure the viewer of a scene; print the medians and write all rounds."""
    with viewer(source) as address:
        (server,) = psutil.Process().children()
        rounds = [
            {"case": case, **asyncio.run(moved(address, case, SIZE, SECONDS, server))}
            for case in cases or ("shaded",)
            for _ in range(ROUNDS)
        ]
    facts = {"machine": machine.describe(torch.device("cpu")), "primitives": len(read_scene(source).open())}
    Path(output).write_text(json.dumps({**facts, "size": SIZE, "rounds": rounds}, indent=1) + "\n")
    for case in dict.fromkeys(each["case"] for each in rounds):
        own = [each for each in rounds if each["case"] == case]
        print(case, {key: round(median(each[key] for each in own), 1) for key in own[0] if key != "case"})


async def moved(
    address: str, case: str, size: int, seconds: float, server: psutil.Process
) -> dict[str, float]:
    """Return frames a second, milliseconds to a frame and of processors for one, and sides of what came."""
    parts = urlsplit(address)
    headers = {"Origin": f"{parts.scheme}://{parts.netloc}"}
    waits: list[float] = []
    async with (
        aiohttp.ClientSession() as session,
        session.ws_connect(f"{address.rstrip('/')}/socket", headers=headers, max_msg_size=0) as socket,
    ):
        start, worked, frame = time.perf_counter(), 0.0, b""
        tfs = (await socket.receive_json())["scene"]["tfs"]
        for number in count(1):
            if number == WARM:
                start, worked, waits = time.perf_counter(), _processor_seconds(server), []
            asked = time.perf_counter()
            for message in _messages(number, case, size, tfs):
                await socket.send_str(json.dumps(message))
            while (answer := await socket.receive(timeout=30)).type != aiohttp.WSMsgType.BINARY:
                pass
            waits.append(1000 * (time.perf_counter() - asked))
            frame = answer.data
            if number > WARM and time.perf_counter() - start > seconds:
                break
        elapsed = time.perf_counter() - start
    return {
        "frames_per_second": len(waits) / elapsed,
        "first_ms": median(waits),
        "first_ms_95": quantiles(waits, n=20)[-1],
        "processor_ms": 1000 * (_processor_seconds(server) - worked) / len(waits),
        "side": _side(frame),
    }


def _processor_seconds(server: psutil.Process) -> float:
    """Seconds that a process has worked, on all cores together."""
    times = server.cpu_times()
    return float(times.user + times.system)


def _messages(number: int, case: str, size: int, tfs: dict[str, Any]) -> list[dict[str, Any]]:
    """A view from a bit further on the way around the scene; or of a function with another opacity."""
    is_function = case == "function"
    direction = {"azimuth": 0 if is_function else (2 * number) % 360 - 180, "polar": 20, "distance": 4}
    camera = {**direction, "target": [0, 0, 0], "fov_y": 30, "width": size, "height": size}
    mode = "volume" if is_function else case
    view = {"type": "view", "id": number, "camera": camera, "mode": mode, "moving": True}
    if not is_function:
        return [view]
    name, tf = next(iter(tfs.items()))
    opacity = [[value, alpha * (0.5 + number % 50 / 100)] for value, alpha in tf["opacity"]]
    value = {name: {**tf, "opacity": opacity}}
    return [{"type": "edit", "part": "", "key": "functions", "value": value, "step": 1}, view]


def _side(frame: bytes) -> int:
    """Pixels of a row of a frame: a header with its length before it, and a JPEG picture."""
    import cv2
    import numpy as np

    length = int.from_bytes(frame[:4], "little")
    return cv2.imdecode(np.frombuffer(frame[4 + length :], np.uint8), cv2.IMREAD_COLOR).shape[1]


if __name__ == "__main__":
    call(main, "benchmarks.viewer texgs.viewer.server")
