"""A client of `texgs view` that turns around the scene as fast as frames come and shows nothing.

What it gets is what a browser on another machine, or with a GPU, can show: none runs on the same cores.
"""

from __future__ import annotations

import asyncio
import json
import time
from statistics import median, quantiles
from urllib.parse import urlsplit

import aiohttp

WARM = 10  # frames before those that count: the resolution has settled then


def turned(address: str, size: int, seconds: float) -> dict[str, float]:
    """Frames a second, milliseconds from asking to the frame, and the sides of what came.

    Args:
        address: that the viewer printed.
        size: pixels of either side of the picture.
        seconds: to turn for.
    """
    return asyncio.run(_turned(address, size, seconds))


async def _turned(address: str, size: int, seconds: float) -> dict[str, float]:
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
    camera = {
        "azimuth": (2 * number) % 360 - 180,
        "polar": 20,
        "distance": 4,
        "fov_y": 30,
        "target": [0, 0, 0],
        "width": size,
        "height": size,
    }
    return {"type": "view", "id": number, "camera": camera, "mode": "shaded", "moving": True}


def _side(frame: bytes) -> int:
    """Pixels of a row of a frame: a header with its length before it, and a JPEG picture."""
    import cv2
    import numpy as np

    length = int.from_bytes(frame[:4], "little")
    return cv2.imdecode(np.frombuffer(frame[4 + length :], np.uint8), cv2.IMREAD_COLOR).shape[1]
