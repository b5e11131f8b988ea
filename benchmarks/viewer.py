"""Frames a second and delays of `texgs view`, by a client that turns around the scene and shows nothing.

`python -m benchmarks.viewer SCENE OUTPUT.json` starts the viewer and asks for frames as fast as they come.
What the client gets is what a browser on another machine can show: none runs on the same cores.
"""

import asyncio
import json
import time
from pathlib import Path
from statistics import median, quantiles
from urllib.parse import urlsplit

import aiohttp
import torch

from benchmarks import machine
from benchmarks.browser import viewer
from benchmarks.command import call
from texgs.scene.scene_file import read_scene

SIZE, SECONDS, ROUNDS = 800, 5.0, 3  # pixels of either side, seconds of a round, and rounds
WARM = 10  # frames before those that count: the resolution has settled then


def main(source: str, output: str) -> None:
    """Measure the viewer of a scene; print the medians and write all rounds."""
    with viewer(source) as address:
        rounds = [asyncio.run(turned(address, SIZE, SECONDS)) for _ in range(ROUNDS)]
    facts = {"machine": machine.describe(torch.device("cpu")), "primitives": len(read_scene(source).open())}
    Path(output).write_text(json.dumps({**facts, "size": SIZE, "rounds": rounds}, indent=1) + "\n")
    print({key: round(median(each[key] for each in rounds), 1) for key in rounds[0]})


async def turned(address: str, size: int, seconds: float) -> dict[str, float]:
    """Return frames a second, milliseconds from asking to the frame, and the sides of what came."""
    parts = urlsplit(address)
    headers = {"Origin": f"{parts.scheme}://{parts.netloc}"}
    waits: list[float] = []
    async with (
        aiohttp.ClientSession() as session,
        session.ws_connect(f"{address.rstrip('/')}/socket", headers=headers, max_msg_size=0) as socket,
    ):
        start, frame, number = time.perf_counter(), b"", 0
        while number < WARM or time.perf_counter() - start < seconds:
            if number == WARM:
                start, waits = time.perf_counter(), []
            number += 1
            asked = time.perf_counter()
            await socket.send_str(json.dumps(_view(number, size)))
            while (message := await socket.receive(timeout=30)).type != aiohttp.WSMsgType.BINARY:
                pass
            waits.append(1000 * (time.perf_counter() - asked))
            frame = message.data
        elapsed = time.perf_counter() - start
    return {
        "frames_per_second": len(waits) / elapsed,
        "first_ms": median(waits),
        "first_ms_95": quantiles(waits, n=20)[-1],
        "side": _side(frame),
    }


def _view(number: int, size: int) -> dict[str, object]:
    """A view from a bit further on the way around the scene."""
    direction = {"azimuth": (2 * number) % 360 - 180, "polar": 20, "distance": 4, "target": [0, 0, 0]}
    camera = direction | {"fov_y": 30, "width": size, "height": size}
    return {"type": "view", "id": number, "camera": camera, "mode": "shaded", "moving": True}


def _side(frame: bytes) -> int:
    """Pixels of a row of a frame: a header with its length before it, and a JPEG picture."""
    import cv2
    import numpy as np

    length = int.from_bytes(frame[:4], "little")
    return cv2.imdecode(np.frombuffer(frame[4 + length :], np.uint8), cv2.IMREAD_COLOR).shape[1]


if __name__ == "__main__":
    call(main, "benchmarks.viewer texgs.viewer.server")
